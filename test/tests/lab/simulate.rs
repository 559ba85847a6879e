//! The simulated log as its readers see it.

use lattice_bag::{BagReader, ReadOptions, Storage};
use lattice_core::geodesy::{EnuFrame, Geodetic, enu_from_flu, utc_ns_from_gps};
use lattice_lab::datasets::{
    BOBCAT_LEAP_SECONDS, BobcatOptions, BobcatSummary, bobcat_origin, bobcat_start_ns, write_bobcat,
};
use lattice_lab::simulate::{BASE_FROM_IMU_M, INS_POSITION_RMS_M};
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::novatel_oem7_msgs::INSPVAX;
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_msgs::{RosMessage, cdr};
use lattice_nodes::files::points::{PointFileOptions, read_points};
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

const DURATION_S: f64 = 3.0;

fn options(out: &Path, storage: Storage, seed: u64) -> BobcatOptions {
    BobcatOptions {
        seed,
        duration_s: DURATION_S,
        begin_s: 0.0,
        person: false,
        scans: false,
        ins_offset: [0.0; 4],
        storage,
        out: out.to_owned(),
        overwrite: false,
    }
}

fn write(out: &Path, storage: Storage, seed: u64) -> BobcatSummary {
    write_bobcat(&options(out, storage, seed), &mut |_| {}).unwrap()
}

/// All messages: topic, log time and bytes, in order.
fn read(bag: &Path) -> Vec<(String, i64, Vec<u8>)> {
    let reader = BagReader::open(bag).unwrap();
    let names: Vec<_> = reader.topics().iter().map(|t| t.name.clone()).collect();
    let messages = reader.messages(&ReadOptions::default()).unwrap();
    let messages = messages.map(Result::unwrap);
    let messages = messages.map(|m| (names[m.topic].clone(), m.log_time_ns, m.data));
    messages.collect()
}

fn decode<M: RosMessage>(bag: &Path, topic: &str) -> Vec<M> {
    let messages = read(bag).into_iter().filter(|(name, ..)| name == topic);
    messages
        .map(|(_, _, data)| cdr::from_slice(&data).unwrap())
        .collect()
}

/// Rows of `poses.csv`: stamp and pose.
fn true_poses(bag: &Path) -> Vec<(i64, Isometry3<f64>)> {
    let text = fs::read_to_string(bag.join("truth/poses.csv")).unwrap();
    let row = |line: &str| {
        let (stamp, rest) = line.split_once(',').unwrap();
        let v: Vec<f64> = rest.split(',').map(|cell| cell.parse().unwrap()).collect();
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(v[6], v[3], v[4], v[5]));
        (
            stamp.parse().unwrap(),
            Isometry3::from_parts(Translation3::new(v[0], v[1], v[2]), rotation),
        )
    };
    text.lines().skip(1).map(row).collect()
}

/// Points of `points.ply`.
fn true_points(bag: &Path) -> Vec<[f64; 3]> {
    let path = bag.join("truth/points.ply");
    let file = read_points(&path, &PointFileOptions::default());
    file.unwrap().points_m
}

#[test]
fn the_bag_has_the_topics_rates_and_qos_of_the_machine() {
    let folder = tempfile::tempdir().unwrap();
    for storage in [Storage::Mcap, Storage::Sqlite3] {
        let bag = folder.path().join(storage.identifier());
        let summary = write(&bag, storage, 1);
        let reader = BagReader::open(&bag).unwrap();
        assert_eq!(reader.message_count(), summary.messages);
        let topics = reader.topics().iter();
        let topics: BTreeMap<_, _> = topics.map(|topic| (topic.name.as_str(), topic)).collect();
        let expected = [
            ("/ins/odometry", Odometry::TYPE, 100.0, false),
            ("/left/points", PointCloud2::TYPE, 75.0, false),
            ("/novatel/oem7/inspvax", INSPVAX::TYPE, 100.0, false),
            ("/right/points", PointCloud2::TYPE, 75.0, false),
            ("/tf", TFMessage::TYPE, 100.0, false),
            ("/tf_static", TFMessage::TYPE, 0.0, true),
            ("/top/points", PointCloud2::TYPE, 75.0, false),
        ];
        assert!(topics.keys().copied().eq(expected.map(|(name, ..)| name)));
        for (name, type_name, rate_hz, latched) in expected {
            let topic = topics[name];
            assert_eq!(topic.type_name, type_name);
            assert_eq!(topic.is_latched(), latched);
            assert_eq!(topic.offered_qos.len(), 1, "{name}");
            let count = topic.message_count as f64;
            let expected = if latched { 1.0 } else { rate_hz * DURATION_S };
            let missing = expected - count;
            assert!(missing.abs() <= 4.0, "{count} messages on {name}");
            assert_ne!(topic.definition.as_deref().unwrap_or(""), "", "{name}");
        }
    }
}

#[test]
fn the_same_seed_gives_the_same_messages_whatever_the_threads_and_the_storage() {
    let folder = tempfile::tempdir().unwrap();
    let with = |threads: usize, name: &str, storage, seed| {
        let bag = folder.path().join(name);
        let pool = lattice_lab::pool(threads).unwrap();
        pool.install(|| write(&bag, storage, seed));
        bag
    };
    let one = with(1, "a/log", Storage::Mcap, 7);
    let two = with(2, "b/log", Storage::Mcap, 7);
    let truth = ["truth/points.ply", "truth/poses.csv", "truth/site.yaml"];
    for file in ["log_0.mcap", "metadata.yaml"].into_iter().chain(truth) {
        let [one, two] = [&one, &two].map(|bag| fs::read(bag.join(file)).unwrap());
        assert!(one == two, "{file} differs");
    }
    let other_storage = with(3, "c/log", Storage::Sqlite3, 7);
    assert!(read(&one) == read(&other_storage));
    let other_seed = with(2, "d/log", Storage::Mcap, 8);
    assert!(read(&one) != read(&other_seed));
}

#[test]
fn every_true_point_belongs_to_a_measured_one() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("log");
    let summary = write(&bag, Storage::Mcap, 2);
    let truth = true_points(&bag);
    assert_eq!(truth.len() as u64, summary.points);
    let poses = true_poses(&bag);
    let mounts: BTreeMap<_, _> = decode::<TFMessage>(&bag, "/tf_static")
        .remove(0)
        .transforms
        .into_iter()
        .map(|t| (t.child_frame_id.clone(), isometry(&t.transform)))
        .collect();
    let turntable: Vec<_> = decode::<TFMessage>(&bag, "/tf")
        .into_iter()
        .map(|mut m| m.transforms.remove(0))
        .map(|t| (t.header.stamp.to_ns(), isometry(&t.transform)))
        .collect();
    let (mut next, mut squares, mut clouds) = (0, 0.0, 0);
    for (topic, _, data) in read(&bag)
        .iter()
        .filter(|(topic, ..)| topic.ends_with("/points"))
    {
        let cloud: PointCloud2 = cdr::from_slice(data).unwrap();
        assert_eq!(cloud.row_step as usize, cloud.data.len());
        let moving = topic == "/top/points";
        for point in cloud.data.chunks_exact(20) {
            let value = |at: usize| f32::from_le_bytes(point[at..at + 4].try_into().unwrap());
            let offset_ns = u32::from_le_bytes(point[16..20].try_into().unwrap());
            let time_ns = cloud.header.stamp.to_ns() + i64::from(offset_ns);
            let mut map_from_laser = at(&poses, time_ns);
            if moving {
                map_from_laser *= at(&turntable, time_ns);
            }
            map_from_laser *= mounts[&cloud.header.frame_id];
            let measured = map_from_laser * Point3::new(value(0), value(4), value(8)).cast::<f64>();
            let expected = Point3::from(truth[next]);
            next += 1;
            squares += (measured - expected).norm_squared();
            assert!((measured - expected).norm() < 0.1, "{measured} on {topic}");
        }
        clouds += 1;
    }
    assert_eq!((next, clouds), (truth.len(), summary.clouds));
    // What remains is the range noise; interpolation of a shaking machine adds little.
    let rms_m = (squares / next as f64).sqrt();
    assert!((0.0115..0.0130).contains(&rms_m), "{rms_m} m");
}

#[test]
fn inspvax_with_lever_arm_and_undulation_is_the_odometry() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("log");
    write(&bag, Storage::Sqlite3, 3);
    let map = EnuFrame::new(bobcat_origin().unwrap());
    let odometry = decode::<Odometry>(&bag, "/ins/odometry");
    let inspvax = decode::<INSPVAX>(&bag, "/novatel/oem7/inspvax");
    let poses = true_poses(&bag);
    assert_eq!([odometry.len(), poses.len()], [inspvax.len(); 2]);
    let mut error_squares = 0.0;
    for ((odometry, ins), (stamp_ns, truth)) in odometry.iter().zip(&inspvax).zip(&poses) {
        let header = &ins.nov_header;
        let (week, ms) = (
            u32::from(header.gps_week_number),
            header.gps_week_milliseconds,
        );
        let valid_ns = utc_ns_from_gps(week, ms, BOBCAT_LEAP_SECONDS);
        assert_eq!([valid_ns, odometry.header.stamp.to_ns()], [*stamp_ns; 2]);
        let height_m = ins.height + f64::from(ins.undulation);
        let place = Geodetic::from_degrees(ins.latitude, ins.longitude, height_m).unwrap();
        let in_place = enu_from_flu(ins.roll, ins.pitch, ins.azimuth);
        let rotation = map.enu_from_local_level(&place) * in_place;
        let base = map.enu_from_geodetic(&place) - rotation * Vector3::from(BASE_FROM_IMU_M);
        let p = &odometry.pose.pose.position;
        assert!((base - Vector3::new(p.x, p.y, p.z)).norm() < 1e-6);
        let q = &odometry.pose.pose.orientation;
        let turned = UnitQuaternion::from_quaternion(Quaternion::new(q.w, q.x, q.y, q.z));
        assert!(turned.angle_to(&rotation) < 1e-6);
        error_squares += (base - truth.translation.vector).norm_squared();
    }
    let rms_m = (error_squares / poses.len() as f64).sqrt();
    // The log is far shorter than the wander.
    assert!((0.2..2.5).contains(&(rms_m / INS_POSITION_RMS_M)));
    assert_eq!(poses[0].0, bobcat_start_ns());
}

#[test]
fn an_earlier_log_is_replaced_only_when_allowed() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("log");
    write(&out, Storage::Mcap, 1);
    let again = |overwrite| {
        let mut fractions = Vec::new();
        let options = BobcatOptions {
            overwrite,
            ..options(&out, Storage::Sqlite3, 2)
        };
        let written = write_bobcat(&options, &mut |fraction| fractions.push(fraction));
        (written, fractions)
    };
    let refused = again(false).0.unwrap_err().to_string();
    assert!(refused.contains("exists already"), "{refused}");
    let (written, fractions) = again(true);
    assert_eq!(
        BagReader::open(&out).unwrap().message_count(),
        written.unwrap().messages
    );
    assert!(!out.join("log_0.mcap").exists());
    assert!(fractions.is_sorted() && fractions.last() == Some(&1.0));
}

#[test]
fn foreign_files_are_never_removed() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("log");
    write(&out, Storage::Mcap, 1);
    let notes = out.join("truth/notes.txt");
    fs::write(&notes, "mine").unwrap();
    let options = BobcatOptions {
        overwrite: true,
        ..options(&out, Storage::Mcap, 2)
    };
    assert!(write_bobcat(&options, &mut |_| {}).is_err());
    assert_eq!(fs::read_to_string(&notes).unwrap(), "mine");
    assert!(out.join("truth/points.ply").exists() && out.join("log_0.mcap").exists());
}

fn isometry(t: &lattice_msgs::geometry_msgs::Transform) -> Isometry3<f64> {
    let (p, q) = (&t.translation, &t.rotation);
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(q.w, q.x, q.y, q.z));
    Isometry3::from_parts(Translation3::new(p.x, p.y, p.z), rotation)
}

/// Linear and spherical interpolation between the two samples about a time.
fn at(samples: &[(i64, Isometry3<f64>)], time_ns: i64) -> Isometry3<f64> {
    let next = samples.partition_point(|&(stamp_ns, _)| stamp_ns <= time_ns);
    let ((from_ns, from), (to_ns, to)) = (samples[next - 1], samples[next]);
    from.lerp_slerp(&to, (time_ns - from_ns) as f64 / (to_ns - from_ns) as f64)
}
