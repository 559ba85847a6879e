//! Clouds of a simulated lidar, over DDS, to odometry, path and transforms.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

use lattice_lab::simulate::drive::{Drive, DriveScan, DriveScene};
use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::nav_msgs::{Odometry, Path};
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_nodes::lidar_odometry::OdometryReport;
use lattice_nodes::report;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Runtime, SubscriptionExecutor};
use lattice_test::clouds::timed_cloud;
use lattice_test::domain::TestDomain;
use lattice_test::peer::{Nodes, params};

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
            to::<Path>(paths),
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
    let long = next(&path, |path: &Path| path.poses.len() >= 5, || {});
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
