//! Logs whose clouds and poses have different clocks.

use std::path::{Path, PathBuf};

use lattice_bag::{BagReader, BagWriter, ReadOptions, Storage, TopicSpec, WriterOptions};
use lattice_msgs::RosMessage;
use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::cdr;
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_nodes::convert::geometry;
use nalgebra::{Isometry3, Quaternion, UnitQuaternion};

use crate::attitude::replay;
use crate::lattice;

/// Every fourth point of a drive through a hall, with its true poses on `/odom`.
fn sound(folder: &Path) -> PathBuf {
    let drive = folder.join("drive");
    let out = drive.display().to_string();
    let scene = ["simulate", "drive", "--scene", "indoor", "--duration", "40"];
    assert!(
        lattice(&[&scene[..], &["--out", &out]].concat())
            .status
            .success()
    );
    let mut messages = Vec::new();
    for line in std::fs::read_to_string(drive.join("truth.tum"))
        .unwrap()
        .lines()
    {
        if let Some((time, pose)) = line.split_once(' ') {
            let (s, ns) = time.split_once('.').unwrap();
            let stamp_ns = s.parse::<i64>().unwrap() * 1_000_000_000 + ns.parse::<i64>().unwrap();
            let values: Vec<f64> = pose.split(' ').map(|v| v.parse().unwrap()).collect();
            let [x, y, z, i, j, k, w] = values.try_into().unwrap();
            let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
            let map_from_lidar = Isometry3::from_parts([x, y, z].into(), rotation);
            let mut odometry = Odometry {
                header: geometry::header("map", stamp_ns),
                child_frame_id: "lidar".into(),
                ..Odometry::default()
            };
            odometry.pose.pose = geometry::pose_from(&map_from_lidar);
            messages.push((stamp_ns, 0, cdr::to_vec(&odometry).unwrap()));
        }
    }
    let reader = BagReader::open(&drive).unwrap();
    for message in reader.messages(&ReadOptions::default()).unwrap() {
        let message = message.unwrap();
        if reader.topics()[message.topic].type_name == PointCloud2::TYPE {
            let mut cloud: PointCloud2 = cdr::from_slice(&message.data).unwrap();
            let points = cloud.data.chunks(cloud.point_step as usize).step_by(4);
            cloud.data = points.flatten().copied().collect::<Vec<u8>>().into();
            cloud.row_step = cloud.data.len() as u32;
            (cloud.width, cloud.height) = (cloud.row_step / cloud.point_step, 1);
            messages.push((message.log_time_ns, 1, cdr::to_vec(&cloud).unwrap()));
        }
    }
    let log = folder.join("sound");
    write(&log, messages);
    log
}

/// Writes messages of `/odom` (0) and `/points` (1) in order of their log time.
fn write(log: &Path, mut messages: Vec<(i64, usize, Vec<u8>)>) {
    messages.sort_by_key(|(log_time_ns, _, _)| *log_time_ns);
    let mut writer = BagWriter::create(log, Storage::Mcap, WriterOptions::default()).unwrap();
    for (name, type_name) in [("/odom", Odometry::TYPE), ("/points", PointCloud2::TYPE)] {
        let spec = TopicSpec {
            name: name.to_owned(),
            type_name: type_name.to_owned(),
            type_hash: String::new(),
            definition: None,
            offered_qos: Vec::new(),
        };
        writer.add_topic(spec).unwrap();
    }
    for (log_time_ns, topic, data) in messages {
        writer.write(topic, log_time_ns, &data).unwrap();
    }
    writer.finish().unwrap();
}

/// Copy of a log with another clock of its clouds; their log times are of it too if `is_sorted`.
fn with_clock(log: &Path, name: &str, offset_s: i64, is_sorted: bool) -> PathBuf {
    let copy = log.with_file_name(name);
    let reader = BagReader::open(log).unwrap();
    let mut messages = Vec::new();
    for message in reader.messages(&ReadOptions::default()).unwrap() {
        let message = message.unwrap();
        let mut log_time_ns = message.log_time_ns;
        let mut data = message.data;
        if reader.topics()[message.topic].type_name == PointCloud2::TYPE {
            let mut cloud: PointCloud2 = cdr::from_slice(&data).unwrap();
            let stamp_ns = cloud.header.stamp.to_ns() + offset_s * 1_000_000_000;
            cloud.header.stamp = Time::from_ns(stamp_ns);
            data = cdr::to_vec(&cloud).unwrap();
            if is_sorted {
                log_time_ns += offset_s * 1_000_000_000;
            }
        }
        messages.push((log_time_ns, message.topic, data));
    }
    write(&copy, messages);
    copy
}

#[test]
fn clouds_of_another_clock_are_refused_with_the_offset_that_mends_them() {
    let folder = tempfile::tempdir().unwrap();
    let log = sound(folder.path());
    let (status, printed, expected) = replay(&log, &[]);
    assert_eq!(status, 0, "{printed}");
    assert!(!printed.contains("clouds fit"), "{printed}");
    let expected = expected.unwrap();

    // The order of the log hides the difference, the poses show it.
    for (name, offset_s) in [("behind", 3), ("ahead", -3)] {
        let other = with_clock(&log, name, offset_s, true);
        let (status, printed, map) = replay(&other, &[]);
        let words = format!("(`time.offset_s: {}`)", -offset_s);
        assert_eq!(status, 1, "{printed}");
        assert!(printed.contains(&words) && map.is_none(), "{printed}");
        let (status, printed, map) = replay(&other, &["--trust-stamps"]);
        assert_eq!(status, 0, "{printed}");
        assert_ne!(map.unwrap().keys(), expected.keys());
        let offset = format!("time.offset_s:={}.0", -offset_s);
        let (status, printed, map) = replay(&other, &["-p", &offset]);
        assert_eq!(status, 0, "{printed}");
        assert_eq!(map.unwrap().keys(), expected.keys(), "{printed}");
    }
}

#[test]
fn clouds_that_no_pose_covers_name_the_difference_of_the_clocks() {
    let folder = tempfile::tempdir().unwrap();
    let log = sound(folder.path());
    let (_, _, expected) = replay(&log, &[]);
    let expected = expected.unwrap();
    for (name, offset_s) in [("gps", 18), ("utc", -18)] {
        let other = with_clock(&log, name, offset_s, false);
        let (status, printed, map) = replay(&other, &[]);
        assert_eq!(status, 1, "{printed}");
        let words = format!(
            "differ by 18 s, that of GPS time and UTC: set `time.offset_s: {}`",
            -offset_s
        );
        assert!(printed.contains(&words), "{printed}");
        assert!(map.is_none_or(|map| map.keys().is_empty()));
        let offset = format!("time.offset_s:={}.0", -offset_s);
        let (status, printed, map) = replay(&other, &["-p", &offset]);
        assert_eq!(status, 0, "{printed}");
        assert_eq!(map.unwrap().keys(), expected.keys(), "{printed}");
    }
}
