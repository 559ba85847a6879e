//! Logs whose attitudes contradict the way of the machine, or an Imu.

use std::f64::consts::PI;
use std::path::Path;

use lattice_bag::{BagWriter, Storage, TopicSpec, WriterOptions};
use lattice_core::pose::AttitudeConvention;
use lattice_core::voxels::file::MapContents;
use lattice_msgs::RosMessage;
use lattice_msgs::cdr;
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::sensor_msgs::{Imu, PointCloud2};
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_nodes::convert::cloud::{Precision, message_from_points};
use lattice_nodes::convert::geometry;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::lattice;

const START_NS: i64 = 1_700_000_000_000_000_000;

/// A log of a machine that drives a circle, with attitudes in a convention.
fn write(log: &Path, convention: AttitudeConvention) {
    let drive = |time_s: f64| {
        let angle = 0.2 * time_s;
        let place = Vector3::new(10.0 * angle.sin(), -10.0 * angle.cos(), 0.0);
        let attitude = UnitQuaternion::from_euler_angles(0.0, 0.0, angle);
        Isometry3::from_parts(place.into(), attitude)
    };
    write_drive(log, 40, drive, convention, None);
}

/// A log of a machine that drives over slopes, with an Imu that is mounted upside down.
fn write_slopes(log: &Path, convention: AttitudeConvention, stated_mount: UnitQuaternion<f64>) {
    let drive = |time_s: f64| {
        let wave = |size: f64, rad_per_s: f64| size * (rad_per_s * time_s).sin();
        let place = Vector3::new(2.0 * time_s, 0.0, 0.0);
        let attitude =
            UnitQuaternion::from_euler_angles(wave(0.08, 0.5), wave(0.1, 0.7), wave(0.2, 0.3));
        Isometry3::from_parts(place.into(), attitude)
    };
    write_drive(log, 120, drive, convention, Some(stated_mount));
}

/// A log of a drive with odometry at 10 Hz, clouds and, if its mount is stated, an Imu at 50 Hz.
fn write_drive(
    log: &Path,
    length_s: i64,
    drive: impl Fn(f64) -> Isometry3<f64>,
    convention: AttitudeConvention,
    stated_mount: Option<UnitQuaternion<f64>>,
) {
    let mut writer = BagWriter::create(log, Storage::Mcap, WriterOptions::default()).unwrap();
    let mut topic = |name: &str, type_name: &str| {
        let topic = TopicSpec {
            name: name.to_owned(),
            type_name: type_name.to_owned(),
            type_hash: String::new(),
            definition: None,
            offered_qos: Vec::new(),
        };
        writer.add_topic(topic).unwrap()
    };
    let poses = topic("/odometry", Odometry::TYPE);
    let clouds = topic("/points", PointCloud2::TYPE);
    let imu = stated_mount.map(|mount| {
        let topics = [
            topic("/imu", Imu::TYPE),
            topic("/tf_static", TFMessage::TYPE),
        ];
        (topics, mount)
    });
    if let Some(([_, statics], mount)) = &imu {
        let mount = Isometry3::from_parts(Vector3::zeros().into(), *mount);
        let mount = geometry::transform_stamped("base_link", "imu_link", START_NS, &mount);
        let message = TFMessage {
            transforms: vec![mount],
        };
        let message = cdr::to_vec(&message).unwrap();
        writer.write(*statics, START_NS, &message).unwrap();
    }
    // Distinct in all directions, so that another attitude gives another map.
    let points: Vec<_> = (0..200)
        .map(|i| {
            let i = f64::from(i);
            Vector3::new(3.0 + 0.05 * i, (0.3 * i).sin(), 0.01 * i)
        })
        .collect();
    for number in 0..50 * length_s {
        let stamp_ns = START_NS + number * 20_000_000;
        let time_s = number as f64 * 0.02;
        let truth = drive(time_s);
        if let Some(([imu, _], _)) = &imu {
            let message = cdr::to_vec(&measured(&drive, time_s, stamp_ns)).unwrap();
            writer.write(*imu, stamp_ns, &message).unwrap();
        }
        if number % 5 == 0 {
            let given = convention.to_enu(&truth.rotation);
            let mut pose = Odometry {
                header: geometry::header("map", stamp_ns),
                child_frame_id: "base_link".into(),
                ..Odometry::default()
            };
            pose.pose.pose = geometry::pose_from(&Isometry3::from_parts(truth.translation, given));
            let message = cdr::to_vec(&pose).unwrap();
            writer.write(poses, stamp_ns, &message).unwrap();
        }
        if number % 25 == 0 {
            let header = geometry::header("base_link", stamp_ns);
            let cloud = message_from_points(header, &points, Precision::Float32);
            let message = cdr::to_vec(&cloud).unwrap();
            writer.write(clouds, stamp_ns, &message).unwrap();
        }
    }
    writer.finish().unwrap();
}

/// Sample of an Imu that is mounted upside down.
fn measured(drive: impl Fn(f64) -> Isometry3<f64>, time_s: f64, stamp_ns: i64) -> Imu {
    let imu_from_base = UnitQuaternion::from_euler_angles(PI, 0.0, 0.0);
    let [from, to] = [-0.001, 0.001].map(|step_s| drive(time_s + step_s).rotation);
    let rate = imu_from_base * ((from.inverse() * to).scaled_axis() / 0.002);
    let force = imu_from_base * (drive(time_s).rotation.inverse() * Vector3::new(0.0, 0.0, 9.81));
    let vector = |v: Vector3<f64>| lattice_msgs::geometry_msgs::Vector3 {
        x: v.x,
        y: v.y,
        z: v.z,
    };
    let mut imu = Imu {
        header: geometry::header("imu_link", stamp_ns),
        angular_velocity: vector(rate),
        linear_acceleration: vector(force),
        ..Imu::default()
    };
    imu.orientation_covariance[0] = -1.0;
    imu
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
fn a_pitch_that_gravity_and_turning_rates_contradict_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let [sound, faulty, turned] =
        ["sound", "faulty", "turned"].map(|name| folder.path().join(name));
    let mount = UnitQuaternion::from_euler_angles(PI, 0.0, 0.0);
    write_slopes(&sound, AttitudeConvention::Enu, mount);
    write_slopes(&faulty, AttitudeConvention::PitchUp, mount);
    write_slopes(&turned, AttitudeConvention::Enu, UnitQuaternion::identity());
    let trusted = ["--trust-stamps"];
    let (status, errors, expected) = replay(&sound, &trusted);
    assert_eq!(status, 0, "{errors}");
    assert!(!errors.contains("/imu"), "{errors}");
    let (status, errors, map) = replay(&faulty, &trusted);
    assert!(status == 1 && map.is_none(), "{errors}");
    let words = [
        "of /imu: set `ins.orientation: pitch_up`",
        "--trust-attitude",
    ];
    assert!(words.iter().all(|word| errors.contains(word)), "{errors}");
    let (status, errors, map) = replay(&faulty, &["--trust-stamps", "--trust-attitude"]);
    assert_eq!((status, map == expected), (0, false), "{errors}");
    let set = ["--trust-stamps", "-p", "ins.orientation:=pitch_up"];
    let (status, errors, map) = replay(&faulty, &set);
    assert!(status == 0 && map.is_some(), "{errors}");
    assert!(!errors.contains("/imu"), "{errors}");
    // The Imu alone is wrong, and the map is not.
    let (status, errors, map) = replay(&turned, &trusted);
    assert_eq!((status, map == expected), (0, true), "{errors}");
    let words = "/imu is turned by roll 180, pitch 0, yaw 0 degrees";
    assert!(errors.contains(words), "{errors}");
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
