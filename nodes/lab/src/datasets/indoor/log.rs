//! The messages of the log in their order.

use std::collections::BTreeMap;
use std::path::PathBuf;

use lattice_bag::{BagQos, BagWriter};
use lattice_core::voxels::VoxelList;
use lattice_msgs::geometry_msgs::PoseStamped;
use lattice_msgs::lattice::HeadsetMesh;
use lattice_msgs::sensor_msgs::{CameraInfo, Image};
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_msgs::vision_msgs::LabelInfo;
use lattice_msgs::{RosMessage, cdr, std_msgs};
use lattice_nodes::convert::geometry::header;
use lattice_nodes::convert::headset_mesh::{chunks_for, in_chunks};

use super::{messages, truth};
use crate::AnyError;
use crate::datasets::write::spec;
use crate::random::seed_of;
use crate::simulate::house::{HeadsetTrial, House, RoomCamera, RoomImages, robot_views};

pub(super) const SECOND_NS: i64 = 1_000_000_000;
/// Time between two looks of the headset, and between two of its poses, ns.
const LOOK_NS: i64 = SECOND_NS;
const POSE_NS: i64 = SECOND_NS / 10;
/// Parts of the seeds of noise: whose camera it is.
const ROBOT: u64 = 0;
const HEADSET: u64 = 1;

/// Options of the log.
#[derive(Clone, Debug)]
pub struct IndoorOptions {
    /// Directory of the bag.
    pub out: PathBuf,
    /// True to replace an earlier log there.
    pub overwrite: bool,
    /// Seed of everything; the same seed gives the same messages.
    pub seed: u64,
    /// Views of the robot.
    pub views: usize,
    /// Time between two of them, s.
    pub period_s: f64,
    /// Pixels in a row of the robot's images; those of the headset are as wide.
    pub width: usize,
    /// Looks of the headset, one a second.
    pub looks: usize,
    /// True for images of colours, false for true labels.
    pub colors: bool,
    /// Volume of the cubic cells that the truth is kept in, m^3.
    pub cell_volume_m3: f64,
}

/// The log as it grows.
pub(super) struct Log<'a> {
    pub(super) options: &'a IndoorOptions,
    pub(super) house: &'a House,
    pub(super) rooms: RoomImages<'a>,
    pub(super) bag: BagWriter,
    pub(super) topics: BTreeMap<&'static str, usize>,
    pub(super) truth: VoxelList,
    /// Time of the next message.
    pub(super) at_ns: i64,
}

impl Log<'_> {
    pub(super) fn add_topics(&mut self) -> Result<(), AnyError> {
        self.add::<Image>("/depth_registered/image_rect", false)?;
        self.add::<CameraInfo>("/rgb/camera_info", false)?;
        self.add::<TFMessage>("/tf", false)?;
        self.add::<std_msgs::String>("/headset/session", true)?;
        self.add::<HeadsetMesh>("/headset/mesh", false)?;
        self.add::<CameraInfo>("/headset/camera_info", false)?;
        self.add::<PoseStamped>("/headset/pose", false)?;
        if self.options.colors {
            self.add::<Image>("/rgb/image_rect_color", false)?;
            return self.add::<Image>("/headset/image", false);
        }
        self.add::<Image>("/labels/image", false)?;
        self.add::<LabelInfo>("/labels/label_info", true)?;
        self.add::<Image>("/headset/labels/image", false)?;
        self.add::<LabelInfo>("/headset/labels/label_info", true)
    }

    fn add<M: RosMessage>(&mut self, topic: &'static str, latched: bool) -> Result<(), AnyError> {
        let depth = if latched { 1 } else { 100 };
        let qos = BagQos {
            depth,
            latched,
            ..BagQos::default()
        };
        let number = self.bag.add_topic(spec::<M>(topic, qos))?;
        self.topics.insert(topic, number);
        Ok(())
    }

    fn write<M: RosMessage>(&mut self, topic: &str, message: &M) -> Result<(), AnyError> {
        let number = self.topics.get(topic).copied().unwrap_or(usize::MAX);
        self.bag.write(number, self.at_ns, &cdr::to_vec(message)?)?;
        Ok(())
    }

    pub(super) fn survey(&mut self, progress: &mut dyn FnMut(f64)) -> Result<(), AnyError> {
        let IndoorOptions {
            views, seed, width, ..
        } = *self.options;
        let camera = RoomCamera::ROBOT;
        let camera = camera.sized(width, width * camera.height / camera.width);
        let period_ns = (self.options.period_s * 1e9) as i64;
        let map_from_house = self.house.map_from_house();
        if !self.options.colors {
            let names = self.house.label_info(header("camera", self.at_ns));
            self.write("/labels/label_info", &names)?;
        }
        let walk = robot_views(self.house, views, seed)?;
        for (number, view) in walk.iter().enumerate() {
            let noise = seed_of(&[seed, ROBOT, number as u64]);
            let image = self.rooms.take(&camera, &view.truth, noise);
            let depth_m = image.measured_depth_m(noise);
            let map_from_camera = map_from_house * view.measured;
            let stamp_ns = self.at_ns;
            self.write("/tf", &messages::robot(stamp_ns, &map_from_camera))?;
            let info = camera.camera_info("camera", stamp_ns);
            self.write("/rgb/camera_info", &info)?;
            let stamped = header("camera", stamp_ns);
            match self.options.colors {
                true => {
                    let colors = image.colors_message(stamped.clone());
                    self.write("/rgb/image_rect_color", &colors)?;
                }
                false => {
                    let labels = image.labels_message(stamped.clone());
                    self.write("/labels/image", &labels)?;
                }
            }
            let depth = image.depth_message(stamped, &depth_m);
            self.write("/depth_registered/image_rect", &depth)?;
            truth::insert(
                &mut self.truth,
                &camera,
                &map_from_camera,
                &depth_m,
                &image.labels,
            );
            self.at_ns += period_ns;
            progress((number + 1) as f64 / views as f64);
        }
        // A pose behind the last image.
        match walk.last() {
            Some(last) => {
                let transforms = messages::robot(self.at_ns, &(map_from_house * last.measured));
                self.write("/tf", &transforms)
            }
            None => Ok(()),
        }
    }

    pub(super) fn headset(&mut self, trial: &HeadsetTrial) -> Result<(), AnyError> {
        let camera = RoomCamera::HEADSET;
        let width = self.options.width;
        let camera = camera.sized(width, width * camera.height / camera.width);
        let headset_from_house = trial.map_from_headset.inverse() * self.house.map_from_house();
        let session = "demo".to_owned();
        let data = session.clone();
        self.write("/headset/session", &std_msgs::String { data })?;
        if !self.options.colors {
            let names = self.house.label_info(header("headset_camera", self.at_ns));
            self.write("/headset/labels/label_info", &names)?;
        }
        let mesh = trial.mesh_message(self.house, header("headset_origin", self.at_ns), &session);
        for chunk in in_chunks(&mesh, chunks_for(&mesh)) {
            self.write("/headset/mesh", &chunk)?;
        }
        let from_ns = self.at_ns;
        for look in 0..self.options.looks {
            let number = look % trial.headset_scans.len().max(1);
            let Some(scan) = trial.headset_scans.get(number) else {
                continue;
            };
            let pose = &scan.headset_from_camera;
            self.at_ns = from_ns + look as i64 * LOOK_NS;
            for _ in 0..LOOK_NS / POSE_NS {
                let message = messages::headset_pose(self.at_ns, pose);
                self.write("/headset/pose", &message)?;
                self.at_ns += POSE_NS;
            }
            // The image of a pose that has come.
            let stamp_ns = self.at_ns - LOOK_NS / 2;
            self.at_ns -= POSE_NS / 2;
            let house_from_camera = headset_from_house.inverse() * pose;
            let noise = seed_of(&[self.options.seed, HEADSET, look as u64]);
            let image = self.rooms.take(&camera, &house_from_camera, noise);
            let info = camera.camera_info("headset_camera", stamp_ns);
            self.write("/headset/camera_info", &info)?;
            let stamped = header("headset_camera", stamp_ns);
            match self.options.colors {
                true => self.write("/headset/image", &image.colors_message(stamped))?,
                false => self.write("/headset/labels/image", &image.labels_message(stamped))?,
            }
        }
        Ok(())
    }
}
