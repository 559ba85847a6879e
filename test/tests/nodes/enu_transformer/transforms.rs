//! Mounts of sensors, odometry, and wrong publishers of transforms.

use std::f64::consts::FRAC_PI_2;

use lattice_msgs::tf2_msgs::TFMessage;
use lattice_nodes::convert::geometry::{isometry_from_transform, transform_stamped};
use lattice_nodes::enu_transformer::TransformerOptions;
use lattice_nodes::enu_transformer::ins::InsSource;
use lattice_test::clouds::{SECOND_NS, cloud, odometry, points, timed_cloud};
use nalgebra::{Isometry3, Vector3};

use super::{Bench, START_NS, STEP_NS, base_cloud, driven};

#[test]
fn a_turning_mount_is_followed() {
    let mut bench = Bench::odometry();
    bench.drive(0, 20);
    let quarter = |step: i64| {
        let angle = std::f64::consts::FRAC_PI_2 * step as f64 / 10.0;
        Isometry3::new(Vector3::new(0.0, 0.0, 2.0), Vector3::z() * angle)
    };
    let at = |step| {
        let stamp_ns = START_NS + step * STEP_NS;
        transform_stamped("base_link", "turntable", stamp_ns, &quarter(step))
    };
    let message = TFMessage {
        transforms: (0..=10).map(at).collect(),
    };
    let stamp_ns = START_NS;
    let seen = [([1.0, 0.0, 0.0], 100_000_000)];
    bench.cloud(timed_cloud("turntable", stamp_ns, &seen), stamp_ns);
    assert!(bench.clouds.is_empty(), "the mount is not known yet");
    let outputs = bench.machine.on_tf(&message, false, stamp_ns);
    bench.take(outputs);
    let out = points(&bench.clouds[0]);
    // Turned by a right angle after 0.1 s, in which the machine drove 0.1 m.
    assert!((out[0] - Vector3::new(0.1, 1.0, 2.0)).norm() < 1e-6);
}

#[test]
fn an_unknown_mount_is_a_reason_of_its_own() {
    let mut bench = Bench::odometry();
    bench.drive(0, 10);
    bench.cloud(cloud("nowhere", START_NS, &[[1.0; 3]]), START_NS);
    bench.tick(START_NS + 5 * SECOND_NS);
    assert_eq!(bench.machine.counts().clouds_no_mount, 1);
}

#[test]
fn transforms_that_are_none_are_counted() {
    let mut bench = Bench::odometry();
    let nowhere = Isometry3::translation(f64::NAN, 0.0, 0.0);
    for is_static in [true, false] {
        bench.tf("base_link", "laser", 0, &nowhere, is_static);
    }
    bench.tf("base_link", "laser", 0, &Isometry3::identity(), true);
    assert_eq!(bench.machine.counts().transforms_refused, 2);
}

#[test]
fn the_odometry_frame_is_published_though_odometry_comes_after_the_pose() {
    let mut bench = Bench::new(TransformerOptions {
        odom_frame: Some("odom".into()),
        ..TransformerOptions::new(InsSource::Odometry)
    });
    // Odometry that stands still, at half the rate and 25 ms late.
    for step in 0..100 {
        bench.pose(&odometry(START_NS + step * STEP_NS, &driven(step)));
        if step % 2 == 0 && step >= 4 {
            let late = step - 3;
            bench.tf("odom", "base_link", late, &Isometry3::identity(), false);
        }
    }
    assert_eq!(bench.transforms.len(), 48);
    for (i, transform) in (0..).zip(&bench.transforms) {
        let step = 2 * i + 1;
        assert_eq!(transform.header.stamp.to_ns(), START_NS + step * STEP_NS);
        assert_eq!(transform.child_frame_id, "odom");
        let pose = isometry_from_transform(&transform.transform).unwrap();
        let off = pose.translation.vector - driven(step).translation.vector;
        assert!(off.norm() < 1e-9, "{step}: {off}");
    }
    // Odometry that comes before the pose is published with the pose.
    bench.tf("odom", "base_link", 101, &driven(1), false);
    bench.pose(&odometry(START_NS + 100 * STEP_NS, &driven(100)));
    let last = bench.transforms.last().unwrap();
    assert_eq!(last.header.stamp.to_ns(), START_NS + 100 * STEP_NS);
}

#[test]
fn wrong_publishers_of_transforms_do_not_take_a_sensor_out() {
    for right_first in [false, true] {
        let mut bench = Bench::odometry();
        bench.drive(0, 10);
        let mount = Isometry3::translation(0.0, 0.0, 2.0);
        let message = || cloud("laser", START_NS, &[[1.0, 0.0, 0.0]]);
        if right_first {
            bench.tf("base_link", "laser", 0, &mount, true);
        }
        bench.cloud(message(), START_NS);
        for i in 0..2000 {
            let wrong = Isometry3::translation(0.0, 9.0, 0.0);
            bench.tf(&format!("other{i}"), "laser", 0, &wrong, true);
            bench.tf("base_link", &format!("thing{i}"), 0, &wrong, false);
        }
        if !right_first {
            bench.tf("base_link", "laser", 0, &mount, true);
        }
        bench.cloud(message(), START_NS);
        assert_eq!(bench.clouds.len(), 2, "{right_first}");
        for cloud in &bench.clouds {
            let found = points(cloud)[0];
            assert!((found - Vector3::new(1.0, 0.0, 2.0)).norm() < 1e-6);
        }
    }
}

#[test]
fn poses_come_of_transforms_that_others_publish() {
    let mut bench = Bench::new(TransformerOptions::new(InsSource::Tf));
    bench.tf(
        "base_link",
        "camera",
        0,
        &Isometry3::translation(0.0, 0.0, 2.0),
        true,
    );
    // A map frame that odometry drifts in, every 50 ms, the odometry between.
    for step in 0..=20 {
        if step % 5 == 0 {
            let drift = Isometry3::translation(0.0, step as f64, 0.0);
            bench.tf("map", "odom", step, &drift, false);
        }
        if step == 12 {
            let stamp_ns = START_NS + step * STEP_NS;
            bench.cloud(cloud("camera", stamp_ns, &[[1.0, 0.0, 0.0]]), stamp_ns);
        }
        bench.tf("odom", "base_link", step, &driven(step), false);
        assert_eq!(bench.clouds.len(), usize::from(step >= 15), "{step}");
    }
    let found = points(&bench.clouds[0])[0];
    assert!(
        (found - Vector3::new(1.12, 12.0, 2.0)).norm() < 1e-6,
        "{found}"
    );
    assert!(bench.transforms.is_empty(), "the others publish them");
    assert!(bench.machine.counts().poses_in > 0);
    // Before all transforms, and after them.
    bench.cloud(cloud("camera", START_NS - SECOND_NS, &[[1.0; 3]]), START_NS);
    bench.tf("odom", "base_link", 21, &driven(21), false);
    assert_eq!(bench.machine.counts().clouds_before_poses, 1);
    bench.cloud(cloud("camera", START_NS + SECOND_NS, &[[1.0; 3]]), START_NS);
    bench.tick(START_NS + 5 * SECOND_NS);
    assert_eq!(bench.machine.counts().clouds_pose_late, 1);
}

#[test]
fn a_correction_moves_poses_and_points_whatever_the_source() {
    let correction = Isometry3::new(Vector3::new(5.0, 0.0, 1.0), Vector3::z() * FRAC_PI_2);
    for source in [InsSource::Odometry, InsSource::Tf] {
        let mut bench = Bench::new(TransformerOptions {
            correction: Some(correction),
            ..TransformerOptions::new(source)
        });
        for step in 0..=2 {
            match source {
                InsSource::Tf => bench.tf("map", "base_link", step, &driven(step), false),
                _ => bench.drive(step, step + 1),
            }
        }
        bench.cloud(base_cloud(START_NS + STEP_NS), START_NS);
        let found = points(&bench.clouds[0])[0];
        assert!(
            (found - Vector3::new(3.0, 1.01, 4.0)).norm() < 1e-6,
            "{source}: {found}"
        );
        for transform in &bench.transforms {
            assert_eq!(transform.transform.translation.z, 1.0);
        }
    }
}
