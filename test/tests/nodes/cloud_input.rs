//! Scans in the nodes' logic: deskewed as clouds are, and counted where they are not converted.

use lattice_msgs::sensor_msgs::{LaserScan, PointCloud2};
use lattice_nodes::cloud_input::cloud_of_scan;
use lattice_nodes::enu_transformer::ins::{InsMessage, InsSource};
use lattice_nodes::enu_transformer::{EnuOutput, EnuTransformer, TransformerOptions};
use lattice_nodes::lidar_odometry::{LidarOdometry, LidarOdometryOptions};
use lattice_test::clouds::{SECOND_NS, header, odometry, points};
use nalgebra::{Isometry3, Vector3};
use std::sync::Arc;

const START_NS: i64 = 1_700_000_000 * SECOND_NS;

/// A scan of three rays, 10 ms apart, the second without a return.
fn scan() -> LaserScan {
    LaserScan {
        header: header("base_link", START_NS),
        angle_increment: 0.5,
        time_increment: 0.01,
        range_max: 30.0,
        ranges: vec![2.0, f32::INFINITY, 2.0],
        ..LaserScan::default()
    }
}

/// Clouds in the map of a machine that drives along x at 10 m/s.
fn transformed(options: TransformerOptions) -> (Vec<Arc<PointCloud2>>, EnuTransformer) {
    let mut machine = EnuTransformer::new(options);
    for step in 0..10 {
        let pose = Isometry3::translation(0.1 * step as f64, 0.0, 0.0);
        let message = odometry(START_NS + step * SECOND_NS / 100, &pose);
        machine.on_ins("odom", InsMessage::Odometry(&message), START_NS);
    }
    let cloud = Arc::new(cloud_of_scan(&scan()).unwrap());
    let outputs = machine.on_cloud("scan", cloud, START_NS).into_iter();
    let clouds = outputs.filter_map(|output| match output {
        EnuOutput::Points(points) => Some(points),
        _ => None,
    });
    (clouds.collect(), machine)
}

#[test]
fn each_ray_is_placed_at_its_own_time() {
    let mut options = TransformerOptions::new(InsSource::Odometry);
    // For clouds of another sensor.
    options.time.field = Some("t".to_owned());
    options.time.unit = Some(lattice_core::cloud::TimeUnit::Microseconds);
    let (clouds, machine) = transformed(options);
    let found = points(&clouds[0]);
    let at =
        |base_m: f64, angle: f64| Vector3::new(base_m + 2.0 * angle.cos(), 2.0 * angle.sin(), 0.0);
    let expected = [at(0.0, 0.0), at(0.2, 1.0)];
    assert_eq!(found.len(), 2);
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).norm() < 1e-6, "{found} {expected}");
    }
    let counts = machine.counts();
    assert_eq!((counts.points_in, counts.points_not_finite), (3, 1));
}

#[test]
fn ranges_of_the_node_hold_for_scans() {
    let mut options = TransformerOptions::new(InsSource::Odometry);
    options.max_range_m = 1.0;
    let (clouds, machine) = transformed(options);
    assert_eq!(clouds[0].width, 0);
    assert_eq!(machine.counts().points_out_of_range, 2);
}

#[test]
fn scans_that_are_not_converted_are_counted_with_their_reason() {
    let message = LaserScan {
        angle_increment: f32::NAN,
        ..scan()
    };
    let error = cloud_of_scan(&message).unwrap_err();
    let mut machine = EnuTransformer::new(TransformerOptions::new(InsSource::Odometry));
    machine.on_unconverted("scan", &error);
    let counts = machine.counts();
    assert_eq!((counts.clouds_in, counts.clouds_malformed), (1, 1));
    let refusal = &machine.refusals().all()[0];
    assert_eq!(
        (refusal.topic.as_str(), refusal.reason.as_str()),
        ("scan", "clouds_malformed")
    );
    assert!(
        refusal.text.contains("`angle_increment` is NaN"),
        "{refusal:?}"
    );

    let mut machine = LidarOdometry::new(LidarOdometryOptions::default());
    machine.on_unconverted("scan", &error);
    let counts = machine.counts();
    assert_eq!((counts.clouds_in, counts.clouds_malformed), (1, 1));
    assert!(
        machine.refusals()[0]
            .text
            .contains("`angle_increment` is NaN")
    );
}
