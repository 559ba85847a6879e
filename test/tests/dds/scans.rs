//! Scans of three lasers, 5 ms apart, to clouds in the map; a driver that changes its type; odometry of a Livox.

use std::collections::BTreeSet;
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use lattice_lab::simulate::drive::{Drive, DriveScan, DriveScene};
use lattice_msgs::livox_interfaces::{CustomMsg, CustomPoint};
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::sensor_msgs::{LaserScan, PointCloud2};
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Publisher, Runtime, SubscriptionExecutor};
use lattice_test::clouds::{cloud, header, odometry, points};
use lattice_test::domain::TestDomain;
use lattice_test::peer::{Nodes, params};
use nalgebra::Isometry3;

/// Long enough for a loaded machine; a test that passes does not wait for it.
const PATIENCE: Duration = Duration::from_secs(60);
const START_NS: i64 = 1_700_000_000_000_000_000;
const PERIOD_NS: i64 = 5_000_000;
const SCANS: i64 = 200;
const RAYS: usize = 5;
/// Speed of the machine along x, m/s.
const SPEED: f64 = 10.0;
const TOPICS: [&str; 3] = ["left/scan", "right/scan", "top/scan"];

/// A scan of the scanner of a number, by which its range differs.
fn scan(scanner: usize, stamp_ns: i64) -> LaserScan {
    let mut ranges = vec![range_m(scanner) as f32; RAYS];
    ranges[1] = f32::INFINITY;
    LaserScan {
        header: header("base_link", stamp_ns),
        angle_min: -FRAC_PI_2 as f32,
        angle_max: FRAC_PI_2 as f32,
        angle_increment: (FRAC_PI_2 / 2.0) as f32,
        time_increment: 1e-3,
        scan_time: 5e-3,
        range_min: 0.1,
        range_max: 80.0,
        ranges,
        intensities: Vec::new(),
    }
}

fn range_m(scanner: usize) -> f64 {
    5.0 + scanner as f64
}

/// Scanner of a cloud by its last ray, at +90 degrees.
fn scanner_of(cloud: &PointCloud2) -> usize {
    (points(cloud).last().unwrap().y - 5.0).round() as usize
}

/// Position of the machine, m.
fn place_m(stamp_ns: i64) -> f64 {
    (stamp_ns - START_NS) as f64 * 1e-9 * SPEED
}

/// Largest distance of the points of a scan from where its rays ended, m.
fn error_m(cloud: &PointCloud2, scanner: usize) -> f64 {
    let stamp_ns = cloud.header.stamp.to_ns();
    let found = points(cloud);
    assert_eq!(found.len(), RAYS - 1);
    let rays = [0, 2, 3, 4].into_iter();
    let errors = rays.zip(found).map(|(ray, found)| {
        let angle = (ray - 2) as f64 * FRAC_PI_2 / 2.0;
        let base_m = place_m(stamp_ns + ray * 1_000_000);
        let (sin, cos) = angle.sin_cos();
        let at =
            nalgebra::Vector3::new(base_m + range_m(scanner) * cos, range_m(scanner) * sin, 0.0);
        (at - found).norm()
    });
    errors.fold(0.0, f64::max)
}

fn wait_for<M: lattice_msgs::RosMessage>(publisher: &Publisher<M>) {
    let begin = Instant::now();
    while publisher.subscriber_count() == 0 {
        assert!(
            begin.elapsed() < PATIENCE,
            "nobody subscribes to {}",
            publisher.topic()
        );
        std::thread::yield_now();
    }
}

fn pose(poses: &Publisher<Odometry>, stamp_ns: i64) {
    let at = Isometry3::translation(place_m(stamp_ns), 0.0, 0.0);
    poses.publish(odometry(stamp_ns, &at)).unwrap();
}

/// The next cloud of a stamp.
fn next(mapped: &Receiver<Arc<PointCloud2>>, stamp_ns: i64) -> Arc<PointCloud2> {
    loop {
        let cloud = mapped.recv_timeout(PATIENCE).unwrap();
        if cloud.header.stamp.to_ns() == stamp_ns {
            return cloud;
        }
    }
}

#[test]
fn scans_of_three_lasers_are_mapped_ray_by_ray_and_a_driver_may_change_its_type() {
    let domain = TestDomain::take();
    let start = |name| Runtime::with_transport(name, RosArgs::default(), &domain.transport());
    let [driver_runtime, listener_runtime] =
        ["driver", "listener"].map(|name| start(name).unwrap());
    let driver = driver_runtime.node("driver").unwrap();
    let listener = listener_runtime.node("listener").unwrap();
    let (sender, mapped) = channel();
    let on_points = move |points| drop(sender.send(points));
    let qos = Qos::reliable(64);
    let _subscription = listener
        .subscribe(
            "points_enu",
            qos,
            SubscriptionExecutor::Dedicated,
            on_points,
        )
        .unwrap();
    let quoted = TOPICS.map(|topic| format!("'{topic}'")).join(",");
    // Nothing may be lost on the way.
    let reliable = TOPICS
        .map(|topic| format!("qos.{topic}.reliability:=reliable"))
        .join(" ");
    let given = format!(
        "points_topics:=[{quoted}] ins.source:=odometry ins.topic:=odom qos.odom.reliability:=reliable \
         qos.points_enu.reliability:=reliable publish_tf:=false {reliable}"
    );
    let nodes = Nodes::start(&domain, &[("enu_transformer", params(&given))]);
    let poses = driver.publisher("odom", Qos::reliable(200)).unwrap();
    let scans = TOPICS.map(|topic| {
        driver
            .publisher::<LaserScan>(topic, Qos::reliable(64))
            .unwrap()
    });
    wait_for(&poses);
    scans.iter().for_each(wait_for);

    // Until the transformer has a scan of each laser, and the listener knows it.
    let begin = Instant::now();
    let mut begin_ns = START_NS;
    let mut known = BTreeSet::new();
    while known.len() < TOPICS.len() {
        assert!(begin.elapsed() < PATIENCE, "scans of {known:?} are mapped");
        pose(&poses, begin_ns);
        for (scanner, publisher) in scans.iter().enumerate() {
            publisher.publish(scan(scanner, begin_ns)).unwrap();
        }
        begin_ns += PERIOD_NS;
        pose(&poses, begin_ns);
        while let Ok(cloud) = mapped.recv_timeout(Duration::from_millis(50)) {
            known.insert(scanner_of(&cloud));
        }
    }
    for step in 0..SCANS {
        let stamp_ns = begin_ns + step * PERIOD_NS;
        for (scanner, publisher) in scans.iter().enumerate() {
            publisher.publish(scan(scanner, stamp_ns)).unwrap();
        }
        pose(&poses, stamp_ns + PERIOD_NS);
        let mut scanners = Vec::new();
        for _ in TOPICS {
            let cloud = next(&mapped, stamp_ns);
            let scanner = scanner_of(&cloud);
            let error_m = error_m(&cloud, scanner);
            assert!(error_m < 1e-5, "scan {step} of {scanner}: {error_m} m");
            scanners.push(scanner);
        }
        scanners.sort_unstable();
        assert_eq!(scanners, [0, 1, 2]);
    }

    // The left driver is started again with another type.
    let [left, _right, _top] = scans;
    drop(left);
    let clouds = driver.publisher::<PointCloud2>(TOPICS[0], qos).unwrap();
    wait_for(&clouds);
    let stamp_ns = begin_ns + SCANS * PERIOD_NS;
    let begin = Instant::now();
    let found = loop {
        assert!(begin.elapsed() < PATIENCE, "no cloud is mapped");
        let message = cloud("base_link", stamp_ns, &[[1.0, 2.0, 3.0]]);
        clouds.publish(message).unwrap();
        match mapped.recv_timeout(Duration::from_millis(500)) {
            Ok(cloud) if cloud.header.stamp.to_ns() == stamp_ns => break points(&cloud),
            _ => {}
        }
    };
    let expected = nalgebra::Vector3::new(place_m(stamp_ns) + 1.0, 2.0, 3.0);
    assert!((found[0] - expected).norm() < 1e-5, "{found:?}");
    nodes.finish();
}

/// A scan as the driver of a Livox publishes it.
fn livox(scan: &DriveScan, first_ns: i64) -> CustomMsg {
    let points = scan.points_m.iter().zip(&scan.times_ns);
    let points = points.map(|(p, time_ns)| CustomPoint {
        offset_time: (time_ns - first_ns) as u32,
        x: p.x as f32,
        y: p.y as f32,
        z: p.z as f32,
        ..CustomPoint::default()
    });
    CustomMsg {
        header: header("livox_frame", START_NS + first_ns),
        points: points.collect(),
        ..CustomMsg::default()
    }
}

#[test]
fn points_of_a_livox_become_odometry() {
    let domain = TestDomain::take();
    let nodes = Nodes::start(
        &domain,
        &[("lidar_odometry", params("base_frame:=livox_frame"))],
    );
    let runtime = Runtime::with_transport("driver", RosArgs::default(), &domain.transport());
    let runtime = runtime.unwrap();
    let node = runtime.node("driver").unwrap();
    let (sender, found) = channel::<Arc<Odometry>>();
    let handler = move |pose| drop(sender.send(pose));
    let shared = SubscriptionExecutor::Shared;
    let odometry = node.subscribe("odometry", Qos::DEFAULT, shared, handler);
    let odometry = odometry.unwrap();
    let points = node.publisher::<CustomMsg>("points", Qos::reliable(5));
    let points = points.unwrap();
    wait_for(&points);
    let begin = Instant::now();
    while odometry.publisher_count() == 0 {
        assert!(begin.elapsed() < PATIENCE, "no odometry");
        std::thread::yield_now();
    }
    let drive = Drive::new(DriveScene::Indoor, 1);
    let mut start = None;
    for number in drive.scans().skip(30).take(12) {
        let scan = drive.scan(number);
        let first_ns = scan.times_ns.iter().copied().min().unwrap();
        let begin = Instant::now();
        let pose = loop {
            assert!(begin.elapsed() < PATIENCE, "no pose of scan {number}");
            // Again until it is taken: the first ones may come before the subscription of the test.
            points.publish(livox(&scan, first_ns)).unwrap();
            match found.recv_timeout(Duration::from_millis(500)) {
                Ok(pose) if pose.header.stamp.to_ns() == START_NS + scan.end_ns => break pose,
                _ => {}
            }
        };
        let truth = drive.pose(scan.end_ns);
        let truth = start.get_or_insert(truth).inverse() * truth;
        let at = &pose.pose.pose.position;
        let at = nalgebra::Vector3::new(at.x, at.y, at.z);
        let error_m = (truth.translation.vector - at).norm();
        assert!(error_m < 0.05, "scan {number}: {error_m} m");
    }
    nodes.finish();
}
