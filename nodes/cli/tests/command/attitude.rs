//! Logs whose attitudes contradict the way of the machine.

use std::path::Path;

use lattice_bag::{BagWriter, Storage, TopicSpec, WriterOptions};
use lattice_core::pose::AttitudeConvention;
use lattice_core::voxels::file::MapContents;
use lattice_msgs::RosMessage;
use lattice_msgs::cdr;
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_nodes::convert::cloud::{Precision, message_from_points};
use lattice_nodes::convert::geometry;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::lattice;

const START_NS: i64 = 1_700_000_000_000_000_000;
const STEP_NS: i64 = 100_000_000;

/// A log of a machine that drives a circle, with attitudes in a convention.
fn write(log: &Path, convention: AttitudeConvention) {
    let mut writer = BagWriter::create(log, Storage::Mcap, WriterOptions::default()).unwrap();
    let topic = |name: &str, type_name: &str| TopicSpec {
        name: name.to_owned(),
        type_name: type_name.to_owned(),
        type_hash: String::new(),
        definition: None,
        offered_qos: Vec::new(),
    };
    let topics = [
        ("/odometry", Odometry::TYPE),
        ("/points", PointCloud2::TYPE),
    ];
    let [poses, clouds] = topics.map(|(name, of)| writer.add_topic(topic(name, of)).unwrap());
    // Distinct in all directions, so that another attitude gives another map.
    let points: Vec<_> = (0..200)
        .map(|i| {
            let i = f64::from(i);
            Vector3::new(3.0 + 0.05 * i, (0.3 * i).sin(), 0.01 * i)
        })
        .collect();
    for number in 0..400 {
        let angle = 0.02 * f64::from(number);
        let place = Vector3::new(10.0 * angle.sin(), -10.0 * angle.cos(), 0.0);
        let attitude = UnitQuaternion::from_euler_angles(0.0, 0.0, angle);
        let stamp_ns = START_NS + i64::from(number) * STEP_NS;
        let given = Isometry3::from_parts(place.into(), convention.to_enu(&attitude));
        let mut pose = Odometry {
            header: geometry::header("map", stamp_ns),
            child_frame_id: "base_link".into(),
            ..Odometry::default()
        };
        pose.pose.pose = geometry::pose_from(&given);
        let message = cdr::to_vec(&pose).unwrap();
        writer.write(poses, stamp_ns, &message).unwrap();
        if number % 5 == 0 {
            let header = geometry::header("base_link", stamp_ns);
            let cloud = message_from_points(header, &points, Precision::Float32);
            let message = cdr::to_vec(&cloud).unwrap();
            writer.write(clouds, stamp_ns, &message).unwrap();
        }
    }
    writer.finish().unwrap();
}

/// Exit status, all that was printed, and the map of a replay, if it was written.
pub fn replay(log: &Path, options: &[&str]) -> (i32, String, Option<MapContents>) {
    let map = log.with_extension("lattice");
    let _ = std::fs::remove_file(&map);
    let [log, out] = [log, &map].map(|path| path.display().to_string());
    let arguments = ["replay", &log, "--direct", "--map-out", &out];
    let output = lattice(&[&arguments[..], options].concat());
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let printed = text(&output.stdout) + &text(&output.stderr);
    let map = std::fs::read(&map).ok();
    let map = map.map(|bytes| MapContents::read(&bytes[..], usize::MAX).unwrap());
    (output.status.code().unwrap(), printed, map)
}

#[test]
fn attitudes_that_turn_against_the_way_are_refused_with_the_parameter_that_mends_them() {
    let folder = tempfile::tempdir().unwrap();
    let [sound, ned] = ["sound", "ned"].map(|name| folder.path().join(name));
    write(&sound, AttitudeConvention::Enu);
    write(&ned, AttitudeConvention::Ned);
    let (status, errors, expected) = replay(&sound, &[]);
    assert_eq!(status, 0, "{errors}");
    let (status, errors, map) = replay(&ned, &[]);
    let words = "turns against the way of the machine";
    assert!(
        status == 1 && map.is_none() && errors.contains(words),
        "{errors}"
    );
    assert!(errors.contains("`ins.orientation: ned`"), "{errors}");
    let (status, errors, map) = replay(&ned, &["--trust-attitude"]);
    assert_eq!((status, map == expected), (0, false), "{errors}");
    let (status, errors, map) = replay(&ned, &["-p", "ins.orientation:=ned"]);
    assert_eq!(status, 0, "{errors}");
    let [map, expected] = [map, expected].map(|map| map.unwrap().keys().to_vec());
    // Rounding of the quaternions moves points on the border of a cell.
    let common = map.iter().filter(|key| expected.contains(key)).count();
    assert!(100 * common > 99 * expected.len().max(map.len()));
}

#[test]
fn a_convention_of_quaternions_is_refused_where_the_poses_have_none() {
    for source in ["tf", "inspvax"] {
        let source = format!("ins.source:={source}");
        let given = ["-p", &source, "-p", "ins.orientation:=ned"];
        let output = lattice(&[&["node", "enu_transformer", "--ros-args"], &given[..]].concat());
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success(), "{errors}");
        assert!(errors.contains("ins.orientation"), "{errors}");
    }
}
