//! Clouds of a simulated lidar, over DDS, to odometry, path and transforms.

use std::collections::HashMap;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

use lattice_core::voxels::file::MapContents;
use lattice_lab::simulate::drive::{Drive, DriveScan, DriveScene};
use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::nav_msgs::{self, Odometry};
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_msgs::visualization_msgs::MarkerArray;
use lattice_nodes::lattice_mapper::MapperReport;
use lattice_nodes::lidar_odometry::OdometryReport;
use lattice_nodes::report;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Runtime, SubscriptionExecutor};
use lattice_test::clouds::timed_cloud;
use lattice_test::domain::TestDomain;
use lattice_test::peer::{Nodes, params};
use nalgebra::{Point3, Vector3};

/// Long enough for a loaded machine; a test that passes does not wait for it.
const PATIENCE: Duration = Duration::from_secs(60);
/// Time after which a cloud that nobody took is sent again.
const AGAIN: Duration = Duration::from_millis(500);
const START_NS: i64 = 1_700_000_000_000_000_000;
const SCANS: usize = 25;

/// A scan as an Ouster's driver sends it: stamped with its beginning, times in nanoseconds since.
fn message(scan: &DriveScan) -> PointCloud2 {
    let first_ns = scan.times_ns.iter().copied().min().unwrap_or(scan.end_ns);
    let points = scan.points_m.iter().zip(&scan.times_ns);
    let points = points.map(|(p, time_ns)| {
        let point = [p.x as f32, p.y as f32, p.z as f32];
        (point, (time_ns - first_ns) as u32)
    });
    timed_cloud("lidar", START_NS + first_ns, &points.collect::<Vec<_>>())
}

/// A handler that passes messages on.
fn to<M>(sender: Sender<Arc<M>>) -> impl Fn(Arc<M>) + Send + 'static
where
    M: Send + Sync + 'static,
{
    move |message| {
        let _ = sender.send(message);
    }
}

/// The next message that is wanted; `again` is called until it comes.
fn next<M>(from: &Receiver<Arc<M>>, wanted: impl Fn(&M) -> bool, again: impl Fn()) -> Arc<M> {
    let begin = Instant::now();
    again();
    loop {
        match from.recv_timeout(AGAIN) {
            Ok(message) if wanted(&message) => return message,
            Ok(_) => {}
            Err(_) => again(),
        }
        assert!(begin.elapsed() < PATIENCE, "no answer");
    }
}

#[test]
fn clouds_become_odometry_path_and_transforms_at_the_times_of_their_last_points() {
    let folder = tempfile::tempdir().unwrap();
    let report_file = folder.path().join("report");
    let domain = TestDomain::take();
    let given = format!("base_frame:=lidar report_file:={}", report_file.display());
    let nodes = Nodes::start(&domain, &[("lidar_odometry", params(&given))]);
    let args = RosArgs::parse([]).unwrap();
    let runtime = Runtime::with_transport("driver", args, &domain.transport()).unwrap();
    let node = runtime.node("driver").unwrap();
    let ((odometry, poses), (paths, path)) = (channel(), channel());
    let (transforms, tf) = channel();
    let _inputs = (
        node.subscribe(
            "odometry",
            Qos::DEFAULT,
            SubscriptionExecutor::Shared,
            to::<Odometry>(odometry),
        ),
        node.subscribe(
            "path",
            Qos::LATCHED,
            SubscriptionExecutor::Shared,
            to::<nav_msgs::Path>(paths),
        ),
        node.subscribe(
            "/tf",
            Qos::TF,
            SubscriptionExecutor::Shared,
            to::<TFMessage>(transforms),
        ),
    );
    let clouds = node
        .publisher::<PointCloud2>("points", Qos::reliable(5))
        .unwrap();

    let drive = Drive::new(DriveScene::Indoor, 1);
    let numbers: Vec<i64> = drive.scans().skip(30).take(SCANS).collect();
    let mut start = None;
    let mut newest_ns = 0;
    for number in numbers {
        let scan = drive.scan(number);
        let cloud = Arc::new(message(&scan));
        let end_ns = START_NS + scan.end_ns;
        let is_of_it = |pose: &Odometry| pose.header.stamp.to_ns() == end_ns;
        let pose = next(&poses, is_of_it, || {
            clouds.publish(Arc::clone(&cloud)).unwrap();
        });
        assert_eq!(
            (pose.header.frame_id.as_str(), pose.child_frame_id.as_str()),
            ("odom", "lidar")
        );
        let truth = drive.pose(scan.end_ns);
        let truth = start.get_or_insert(truth).inverse() * truth;
        let at = &pose.pose.pose.position;
        let error_m = (truth.translation.vector - nalgebra::Vector3::new(at.x, at.y, at.z)).norm();
        assert!(error_m < 0.05, "scan {number}: {error_m} m");
        newest_ns = end_ns;
    }
    let is_newest = |message: &TFMessage| {
        let of_it = |stamp: &Time| stamp.to_ns() == newest_ns;
        message
            .transforms
            .iter()
            .any(|t| of_it(&t.header.stamp) && t.child_frame_id == "lidar")
    };
    next(&tf, is_newest, || {});
    // 2.5 s at up to 1.3 m/s make some poses 0.25 m apart.
    let long = next(&path, |path: &nav_msgs::Path| path.poses.len() >= 5, || {});
    assert_eq!(long.header.frame_id, "odom");
    nodes.finish();
    let report: OdometryReport = report::read(&report_file).unwrap();
    let counts = &report.counts;
    // At 1.3 m/s the first scans lie within 0.3 m.
    assert!((1..=10).contains(&counts.lost_one_place), "{report:?}");
    assert_eq!(
        counts.scans_ok + counts.lost_one_place,
        SCANS as u64,
        "{report:?}"
    );
    assert_eq!(report.counts.submaps, 1);
}

/// Cubes of half a metre around points.
fn cubes(points_m: impl Iterator<Item = Vector3<f64>>) -> HashMap<[i32; 3], usize> {
    let mut cubes = HashMap::new();
    for point in points_m {
        let cube = point.map(|v| (v / 0.5).floor() as i32);
        *cubes.entry(cube.into()).or_default() += 1;
    }
    cubes
}

/// True if one of the cubes or a neighbour of it is among others.
fn is_near(cube: &[i32; 3], others: &HashMap<[i32; 3], usize>) -> bool {
    let near = |i: i32| [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1];
    (0..27).map(near).any(|step| {
        let at = [0, 1, 2].map(|axis| cube[axis] + step[axis]);
        others.contains_key(&at)
    })
}

#[test]
fn a_loop_joins_submaps_and_the_mapper_maps_with_the_corrected_poses() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name).display().to_string();
    let domain = TestDomain::take();
    let odometry = format!(
        "base_frame:=lidar map_frame:=map report_file:={}",
        file("odometry.json")
    );
    let transformer = "points_topics:=[points] ins.source:=odometry ins.topic:=odometry_ok map_frame:=odom \
        base_frame:=lidar publish_tf:=false max_wait_s:=60.0";
    let mapper = format!(
        "follow_corrections:=true cell_size_m:=0.5 map_dir:={} autosave_period_s:=3600.0 report_file:={}",
        folder.path().display(),
        file("mapper.json")
    );
    let nodes = Nodes::start(
        &domain,
        &[
            ("lidar_odometry", params(&odometry)),
            ("enu_transformer", params(transformer)),
            ("lattice_mapper", params(&mapper)),
        ],
    );
    let args = RosArgs::parse([]).unwrap();
    let runtime = Runtime::with_transport("driver", args, &domain.transport()).unwrap();
    let node = runtime.node("driver").unwrap();
    let ((odometry, poses), (lines, markers)) = (channel(), channel());
    let (corrections, corrected) = channel();
    let shared = SubscriptionExecutor::Shared;
    let _inputs = (
        node.subscribe("odometry", Qos::DEFAULT, shared, to::<Odometry>(odometry)),
        node.subscribe(
            "loop_closures",
            Qos::LATCHED,
            shared,
            to::<MarkerArray>(lines),
        ),
        node.subscribe(
            "corrections",
            Qos::LATCHED,
            shared,
            to::<TFMessage>(corrections),
        ),
    );
    let clouds = node
        .publisher::<PointCloud2>("points", Qos::reliable(5))
        .unwrap();

    // A round and a half, with a gap that begins a submap.
    let drive = Drive::new(DriveScene::IndoorAgain, 0);
    let missing = 212..232;
    let (mut map_from_world, mut points_m) = (None, Vec::new());
    for number in drive.scans().filter(|number| !missing.contains(number)) {
        let scan = drive.scan(number);
        let cloud = Arc::new(message(&scan));
        let end_ns = START_NS + scan.end_ns;
        let is_of_it = |pose: &Odometry| pose.header.stamp.to_ns() == end_ns;
        next(&poses, is_of_it, || {
            clouds.publish(Arc::clone(&cloud)).unwrap();
        });
        let map_from_world = map_from_world.get_or_insert(drive.pose(scan.end_ns).inverse());
        let points = scan.points_m.iter().zip(&scan.times_ns);
        points_m.extend(points.map(|(point, time_ns)| {
            (*map_from_world * drive.pose(*time_ns) * Point3::from(*point)).coords
        }));
    }
    let is_joined = |message: &TFMessage| {
        let mut transforms = message.transforms.iter();
        transforms.len() > 10 && transforms.all(|t| t.header.frame_id == "map")
    };
    next(&corrected, is_joined, || {});
    next(
        &markers,
        |lines: &MarkerArray| lines.markers[0].points.len() >= 4,
        || {},
    );
    nodes.finish();
    let found: OdometryReport = report::read(Path::new(&file("odometry.json"))).unwrap();
    assert!(found.loops_closed >= 2, "{found:?}");
    assert_eq!((found.counts.submaps, found.segments_queue_full), (2, 0));
    let mapped: MapperReport = report::read(Path::new(&file("mapper.json"))).unwrap();
    let followed = mapped.corrections.as_ref().unwrap();
    assert!(followed.maps_corrected >= 1, "{mapped:?}");
    assert_eq!(
        (followed.clouds_unplaced, followed.clouds_other_drive),
        (0, 0)
    );

    let map = MapContents::read(File::open(file("autosave.lattice")).unwrap(), 1_000_000).unwrap();
    let list = map.into_list(1_000_000);
    let found = cubes(list.sorted().iter().map(|(key, _)| list.center_m(*key)));
    let truth = cubes(points_m.into_iter());
    let seen: Vec<_> = truth.iter().filter(|(_, points)| **points > 50).collect();
    let mapped = seen
        .iter()
        .filter(|(cube, _)| is_near(cube, &found))
        .count();
    assert!(20 * mapped > 19 * seen.len(), "{mapped} of {}", seen.len());
    let right = found.keys().filter(|cube| is_near(cube, &truth)).count();
    assert!(100 * right > 99 * found.len(), "{right} of {}", found.len());
}
