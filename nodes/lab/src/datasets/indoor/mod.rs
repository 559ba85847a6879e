//! A robot with a depth camera surveys a furnished house, and a headset joins it: a log for the nodes.
//!
//! | topic | type | |
//! |---|---|---|
//! | `/depth_registered/image_rect` | Image, 32FC1 | noise as of structured light |
//! | `/rgb/camera_info` | CameraInfo | |
//! | `/rgb/image_rect_color` or `/labels/image` | Image, rgb8 or mono16 | colours for a network, or true labels |
//! | `/labels/label_info` | LabelInfo, latched | with true labels |
//! | `/tf` | `map` -> `base_link` -> `camera` | as the robot measures them |
//! | `/headset/session`, `/headset/mesh`, `/headset/camera_info`, `/headset/pose` | | in the axes of ROS |
//! | `/headset/image` or `/headset/labels/image`, `/headset/labels/label_info` | | as of the robot |
//!
//! The robot's views come in an even period, then there is a pause, then the headset looks about once a second.

mod log;
mod messages;
mod truth;

use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;

use lattice_bag::{BagWriter, Storage, WriterOptions, replaceable};
use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::voxels::{Payload, VoxelList};
use nalgebra::{Isometry3, Vector3};
use serde::Serialize;

use self::log::{Log, SECOND_NS};
use crate::AnyError;
use crate::options::within;
use crate::simulate::house::{HeadsetTrial, House, RoomImages, Scene};

pub use self::log::IndoorOptions;
pub use truth::{LabelAccuracy, label_accuracy};

/// Time of the first message, UTC, ns since the Unix epoch.
const START_NS: i64 = 1_700_000_000_000_000_000;
/// Time between the survey and the headset, ns.
const PAUSE_NS: i64 = 2 * SECOND_NS;
/// Pictures of the scene, which the headset looks at in turn.
const SCANS: usize = 6;
/// Place of the house in the map, m, and its turn, rad.
const HOUSE: [f64; 4] = [6.0, -4.0, 0.0, 0.6];

/// Log, and the truth that no node knows.
pub struct Indoor {
    /// Numbers of what was written.
    pub summary: IndoorSummary,
    /// True pose of the headset in the map.
    pub map_from_headset: Isometry3<f64>,
    /// Voxels that the robot saw at the poses that it measured, with the true labels.
    pub truth: VoxelList,
}

/// Summary of a written log.
#[derive(Clone, Debug, PartialEq, Default, Serialize)]
pub struct IndoorSummary {
    /// Directory of the bag.
    pub out: PathBuf,
    /// Length of the log, s.
    pub duration_s: f64,
    /// Images of the robot.
    pub images: usize,
    /// Looks of the headset.
    pub looks: usize,
    /// Triangles of its mesh.
    pub triangles: usize,
}

impl fmt::Display for IndoorSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}: {:.1} s, {} images of the robot, {} of the headset, which has a mesh of {} triangles",
            self.out.display(),
            self.duration_s,
            self.images,
            self.looks,
            self.triangles
        )
    }
}

/// Writes the log. `progress` is called with the share done, 0..1.
pub fn write_indoor(
    options: &IndoorOptions,
    progress: &mut dyn FnMut(f64),
) -> Result<Indoor, AnyError> {
    within("views", options.views as f64, 1.0, 1e4)?;
    within("looks", options.looks as f64, 1.0, 1e3)?;
    within("width", options.width as f64, 16.0, 4096.0)?;
    within("period", options.period_s, 0.01, 10.0)?;
    replaceable(&options.out, options.overwrite, &[])?
        .iter()
        .try_for_each(std::fs::remove_file)?;
    let [x, y, z, yaw] = HOUSE;
    let place = Isometry3::new(Vector3::new(x, y, z), Vector3::z() * yaw);
    let house = House::generated(options.seed)?.placed(place);
    let trial = HeadsetTrial::new(&house, Scene::Desk, SCANS, options.seed)?;
    let lattice = Lattice::new(LatticeKind::Cubic, options.cell_volume_m3)?;
    let truth = VoxelList::new(lattice, Vector3::zeros(), usize::MAX)?;
    let writer = WriterOptions::default();
    let mut log = Log {
        options,
        rooms: RoomImages::new(&house, options.seed),
        house: &house,
        bag: BagWriter::create(&options.out, Storage::Mcap, writer)?,
        topics: BTreeMap::new(),
        truth: truth.with_payload(Payload {
            labels: true,
            ..Payload::default()
        }),
        at_ns: START_NS,
    };
    log.add_topics()?;
    log.survey(progress)?;
    log.at_ns += PAUSE_NS;
    log.headset(&trial)?;
    let duration_s = (log.at_ns - START_NS) as f64 * 1e-9;
    log.bag.finish()?;
    progress(1.0);
    Ok(Indoor {
        summary: IndoorSummary {
            out: options.out.clone(),
            duration_s,
            images: options.views,
            looks: options.looks,
            triangles: trial.mesh.len(),
        },
        map_from_headset: trial.map_from_headset,
        truth: log.truth,
    })
}

#[cfg(test)]
mod tests {
    use lattice_bag::{BagReader, ReadOptions};

    use super::*;

    #[test]
    fn a_log_has_every_view_and_look_and_the_same_bytes_each_time() {
        let folder = tempfile::tempdir().unwrap();
        let options = |name: &str, colors| IndoorOptions {
            out: folder.path().join(name),
            overwrite: false,
            seed: 3,
            views: 8,
            period_s: 0.1,
            width: 32,
            looks: 4,
            colors,
            cell_volume_m3: 0.000125,
        };
        let write = |name: &str, colors| write_indoor(&options(name, colors), &mut |_| ()).unwrap();
        let [first, again] = ["first", "again"].map(|name| write(name, false));
        assert!(first.truth.len() > 500);
        assert!(write_indoor(&options("first", false), &mut |_| ()).is_err());
        let read = |name: &str| {
            let bag = BagReader::open(&folder.path().join(name)).unwrap();
            let topics = bag.topics().to_vec();
            let all = bag.messages(&ReadOptions::default()).unwrap();
            let message = |message: lattice_bag::BagMessage| {
                (
                    topics[message.topic].name.clone(),
                    message.log_time_ns,
                    message.data,
                )
            };
            all.map(|m| message(m.unwrap())).collect::<Vec<_>>()
        };
        let messages = read("first");
        assert!(messages == read("again") && again.summary.images == 8);
        let count = |topic: &str| messages.iter().filter(|(of, ..)| of == topic).count();
        for (topic, expected) in [
            ("/depth_registered/image_rect", 8),
            ("/labels/image", 8),
            ("/tf", 9),
            ("/headset/labels/image", 4),
            ("/headset/pose", 40),
        ] {
            assert_eq!(count(topic), expected, "{topic}");
        }
        assert!(count("/headset/mesh") > 1);
        write("colors", true);
        let colors = read("colors");
        let colors = colors.iter().filter(|(of, ..)| of == "/headset/image");
        assert_eq!(colors.count(), 4);
    }
}
