//! Lidar odometry: every cloud is counted by its verdict or by the reason for which it has none, live and in replays.

use std::path::Path;

use lattice_bag::{BagReader, BagWriter, Storage, TopicSpec, WriterOptions};
use lattice_core::lattice::LatticeKind;
use lattice_core::odometry::Verdict;
use lattice_lab::simulate::drive::{Drive, DriveScan, DriveScene};
use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::cdr;
use lattice_msgs::geometry_msgs;
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::sensor_msgs::{Imu, PointCloud2};
use lattice_nodes::enu_transformer::TransformerOptions;
use lattice_nodes::lidar_odometry::{LidarOdometry, LidarOdometryOptions};
use lattice_nodes::replay::{self, Pipeline, RunReport, Slice, TopicWishes};
use lattice_test::clouds::{cloud, odometry, timed_cloud};
use lattice_test::maps;
use nalgebra::Isometry3;

const START_NS: i64 = 1_700_000_000_000_000_000;

/// A scan of a drive as an Ouster's driver sends it, later by `delay_ns`.
fn message(scan: &DriveScan, delay_ns: i64) -> PointCloud2 {
    let first_ns = scan.times_ns.iter().copied().min().unwrap_or(scan.end_ns);
    let points = scan.points_m.iter().zip(&scan.times_ns);
    let points = points.map(|(p, time_ns)| {
        let point = [p.x as f32, p.y as f32, p.z as f32];
        (point, (time_ns - first_ns) as u32)
    });
    let stamp_ns = START_NS + delay_ns + first_ns;
    timed_cloud("lidar", stamp_ns, &points.collect::<Vec<_>>())
}

fn of_lidar() -> LidarOdometry {
    LidarOdometry::new(LidarOdometryOptions {
        base_frame: "lidar".into(),
        ..LidarOdometryOptions::default()
    })
}

#[test]
fn every_cloud_is_counted_once() {
    let mut odometry = of_lidar();
    let drive = Drive::new(DriveScene::Indoor, 1);
    let mut verdicts = [0; 3];
    let mut newest = None;
    for number in 30..60 {
        let cloud = message(&drive.scan(number), 0);
        let found = odometry.on_cloud("points", &cloud, number);
        assert_eq!((found.len(), found[0].tag), (1, number));
        verdicts[match found[0].result.verdict {
            Verdict::Ok => 0,
            Verdict::Weak(_) => 1,
            Verdict::Lost(_) => 2,
        }] += 1;
        newest = Some(cloud);
    }
    let counts = odometry.counts().clone();
    assert_eq!(
        (counts.scans_ok, counts.scans_weak),
        (verdicts[0], verdicts[1])
    );
    // The first scan, and those before the machine has moved by 0.3 m at up to 1.3 m/s.
    assert_eq!(counts.lost_one_place, verdicts[2]);
    assert!((3..=10).contains(&counts.lost_one_place), "{counts:?}");
    assert_eq!(counts.submaps, 1);

    // A cloud that comes again, one of another frame, one whose bytes are short.
    let mut newest = newest.unwrap();
    assert!(odometry.on_cloud("points", &newest, 0).is_empty());
    newest.header.stamp.sec += 1;
    let mut short = newest.clone();
    short.data.truncate(100);
    assert!(odometry.on_cloud("points", &short, 0).is_empty());
    newest.header.frame_id = "mast".into();
    assert!(odometry.on_cloud("points", &newest, 0).is_empty());
    // Three points.
    let few = cloud("lidar", START_NS + 6_100_000_000, &[[1.0, 0.0, 0.0]; 3]);
    assert_eq!(odometry.on_cloud("points", &few, 0).len(), 1);
    // A place that the map does not show.
    let elsewhere = Drive::new(DriveScene::Town, 1).scan(62);
    let found = odometry.on_cloud("points", &message(&elsewhere, 0), 0);
    assert_eq!(found.len(), 1);

    let counts = odometry.counts();
    let once = [
        counts.clouds_out_of_order,
        counts.clouds_malformed,
        counts.clouds_no_mount,
        counts.lost_few_points,
        counts.lost_no_overlap,
    ];
    assert_eq!(once, [1; 5], "{counts:?}");
    assert_eq!(counts.clouds_in, 35);
    let reasons: Vec<_> = odometry
        .refusals()
        .iter()
        .map(|r| r.reason.as_str())
        .collect();
    assert_eq!(
        reasons,
        ["clouds_out_of_order", "clouds_malformed", "clouds_no_mount"]
    );
}

#[test]
fn a_tunnel_is_weak_and_then_lost() {
    let mut odometry = of_lidar();
    let drive = Drive::new(DriveScene::Tunnel, 1);
    for number in 50..130 {
        let cloud = message(&drive.scan(number), 0);
        odometry.on_cloud("points", &cloud, number);
    }
    let counts = odometry.counts();
    assert!(counts.scans_ok > 10, "{counts:?}");
    assert!(counts.scans_weak > 0, "{counts:?}");
    assert!(counts.lost_unobservable > 0, "{counts:?}");
    assert_eq!(
        counts.scans_ok + counts.scans_weak + counts.scans_lost(),
        counts.clouds_in
    );
}

/// A gyroscope's sample of a drive, from the true poses 5 ms before and after.
fn imu(drive: &Drive, time_ns: i64) -> Imu {
    let [before, after] = [-5_000_000, 5_000_000].map(|ns| drive.pose(time_ns + ns).rotation);
    let rate = (before.inverse() * after).scaled_axis() / 0.01;
    let mut imu = Imu::default();
    imu.header.stamp = Time::from_ns(START_NS + time_ns);
    imu.header.frame_id = "lidar".into();
    imu.angular_velocity = geometry_msgs::Vector3 {
        x: rate.x,
        y: rate.y,
        z: rate.z,
    };
    imu
}

/// Wheel odometry of a drive, 1 % too short.
fn wheels(drive: &Drive, time_ns: i64) -> Odometry {
    let mut pose = drive.pose(time_ns);
    pose.translation.vector *= 0.99;
    let mut wheels = odometry(START_NS + time_ns, &pose);
    wheels.child_frame_id = "lidar".into();
    wheels
}

#[test]
fn a_scan_waits_for_the_motion_to_its_end_and_is_predicted_by_it() {
    let mut found = of_lidar();
    let drive = Drive::new(DriveScene::Gap, 1);
    let numbers: Vec<i64> = drive.scans().collect();
    let gap = numbers.windows(2).position(|pair| pair[1] > pair[0] + 1);
    let gap = gap.unwrap();
    let numbers = &numbers[gap - 25..gap + 4];
    let mut truth = None;
    let mut now_ns = (numbers[0] - 1) * 100_000_000;
    for &number in numbers {
        let scan = drive.scan(number);
        // The cloud comes when the motion is known up to 20 ms before its end.
        while now_ns < scan.end_ns - 20_000_000 {
            assert!(found.on_imu("imu", &imu(&drive, now_ns)).is_none());
            assert!(found.on_wheels("wheels", &wheels(&drive, now_ns)).is_none());
            now_ns += 10_000_000;
        }
        assert!(
            found
                .on_cloud("points", &message(&scan, 0), number)
                .is_empty()
        );
        let mut registered = None;
        while registered.is_none() {
            assert!(now_ns <= scan.end_ns + 10_000_000);
            found.on_imu("imu", &imu(&drive, now_ns));
            registered = found.on_wheels("wheels", &wheels(&drive, now_ns));
            now_ns += 10_000_000;
        }
        let result = registered.unwrap().result;
        let pose = drive.pose(scan.end_ns);
        let start = truth.get_or_insert(pose);
        let error = result.odom_from_base.inverse() * (start.inverse() * pose);
        let error_m = error.translation.vector.norm();
        assert!(error_m < 0.1, "scan {number}: {error_m} m");
    }
    let counts = found.counts();
    let scans = numbers.len() as u64;
    assert_eq!(
        (counts.scans_with_imu, counts.scans_with_wheels),
        (scans - 1, scans - 1)
    );
    assert_eq!(
        (counts.scans_ok + counts.lost_one_place, counts.submaps),
        (scans, 1)
    );

    // A last cloud whose motion does not come.
    let last = drive.scan(numbers[numbers.len() - 1] + 1);
    assert!(found.on_cloud("points", &message(&last, 0), 7).is_empty());
    assert_eq!(found.finish().unwrap().tag, 7);
    assert!(found.finish().is_none());
    let mut wrong = imu(&drive, now_ns);
    wrong.angular_velocity.x = f64::NAN;
    found.on_imu("imu", &wrong);
    let mut wrong = wheels(&drive, now_ns);
    wrong.child_frame_id = "wheel".into();
    found.on_wheels("wheels", &wrong);
    let counts = found.counts();
    assert_eq!((counts.imu_refused, counts.wheels_refused), (1, 1));
}

fn points_topic() -> TopicSpec {
    TopicSpec {
        name: "/points".into(),
        type_name: "sensor_msgs/msg/PointCloud2".into(),
        type_hash: String::new(),
        definition: None,
        offered_qos: Vec::new(),
    }
}

/// A log of clouds alone: one room, and then a street.
fn write_log(log: &Path) {
    let mut writer = BagWriter::create(log, Storage::Mcap, WriterOptions::default()).unwrap();
    let points = writer.add_topic(points_topic()).unwrap();
    let scenes = [(DriveScene::Indoor, 30..60), (DriveScene::Town, 60..100)];
    for (scene, numbers) in scenes {
        let drive = Drive::new(scene, 1);
        for number in numbers {
            let scan = drive.scan(number);
            let data = cdr::to_vec(&message(&scan, 0)).unwrap();
            writer.write(points, START_NS + scan.end_ns, &data).unwrap();
        }
    }
    writer.finish().unwrap();
}

/// Report of a replay of a log, and the newest pose in the map.
fn replayed(log: &Path) -> (RunReport, Isometry3<f64>) {
    let bag = BagReader::open(log).unwrap();
    let plan = replay::plan(&bag, &TopicWishes::default()).unwrap();
    let mut transformer = TransformerOptions::new(plan.source);
    transformer.map_frame.clone_from(&plan.map_frame);
    transformer.base_frame.clone_from(&plan.base_frame);
    let mut pipeline =
        Pipeline::new(transformer, [maps::options(LatticeKind::Fcc, 0.2)], None).unwrap();
    let slice = &Slice::WHOLE;
    let report = replay::run(&bag, &plan, slice, &mut pipeline, "log", &mut |_| {}).unwrap();
    (report, pipeline.newest_pose().unwrap().map_from_base)
}

#[test]
fn a_replay_maps_one_submap_and_counts_the_scans_of_others() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log");
    write_log(&log);
    let (report, _) = replayed(&log);
    let odometry = report.odometry.as_ref().unwrap();
    let (mapped, elsewhere) = (odometry.scans_mapped, odometry.scans_elsewhere);
    assert_eq!(mapped + elsewhere, odometry.counts.scans_ok);
    assert!(mapped > 15 && elsewhere > 15, "{odometry:?}");
    assert_eq!((odometry.counts.submaps, odometry.submaps_mapped), (2, 1));
    // Segments of the street, tried in the room.
    assert_eq!((odometry.loops_closed, odometry.loops_refused), (0, 2));
    assert_eq!(report.transformer.counts.clouds_out, mapped);
    assert_eq!(report.transformer.counts.poses_out_of_order, 0);
    let said = report.to_string();
    assert!(
        said.contains("in submaps whose place in the map is unknown"),
        "{said}"
    );
}

#[test]
fn a_replay_corrects_its_poses_by_loops_and_joins_submaps() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log");
    let mut writer = BagWriter::create(&log, Storage::Mcap, WriterOptions::default()).unwrap();
    let points = writer.add_topic(points_topic()).unwrap();
    // A round and a half, with a gap that begins a submap.
    let drive = Drive::new(DriveScene::IndoorAgain, 0);
    let missing = 212..232;
    let numbers = drive.scans().filter(|number| !missing.contains(number));
    for number in numbers {
        let scan = drive.scan(number);
        let data = cdr::to_vec(&message(&scan, 0)).unwrap();
        writer.write(points, START_NS + scan.end_ns, &data).unwrap();
    }
    writer.finish().unwrap();
    let (report, pose) = replayed(&log);
    let odometry = report.odometry.as_ref().unwrap();
    assert_eq!(
        (odometry.counts.submaps, odometry.submaps_mapped),
        (2, 2),
        "{odometry:?}"
    );
    assert!(odometry.loops_closed >= 3, "{odometry:?}");
    assert_eq!(odometry.scans_elsewhere, 0);
    let last = drive.scans().last().unwrap();
    let truth = drive.pose(100_000_000).inverse() * drive.pose(100_000_000 * last);
    let apart_m = (pose.translation.vector - truth.translation.vector).norm();
    assert!(apart_m < 0.3, "{apart_m} m");
}
