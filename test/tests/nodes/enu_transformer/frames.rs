//! Frames of poses: mounts of an INS on tf, the frame that a pose is in, and refusals by name.

use std::f64::consts::FRAC_PI_2;

use lattice_core::geodesy::{EnuFrame, Geodetic};
use lattice_msgs::geometry_msgs::{PoseStamped, PoseWithCovarianceStamped};
use lattice_msgs::sensor_msgs::{Imu, NavSatFix};
use lattice_nodes::enu_transformer::TransformerOptions;
use lattice_nodes::enu_transformer::ins::{InsMessage, InsSource};
use lattice_test::clouds::{SECOND_NS, header, odometry, points, pose};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use super::{Bench, START_NS, STEP_NS, base_cloud, driven};

/// An INS one metre ahead, turned by a right angle.
fn base_from_imu() -> Isometry3<f64> {
    Isometry3::new(Vector3::x(), Vector3::z() * FRAC_PI_2)
}

fn imu_odometry(step: i64) -> lattice_msgs::nav_msgs::Odometry {
    let mut message = odometry(START_NS + step * STEP_NS, &(driven(step) * base_from_imu()));
    message.child_frame_id = "imu_link".into();
    message
}

#[test]
fn odometry_of_another_frame_is_moved_by_its_mount_on_tf() {
    for tf_first in [true, false] {
        let mut bench = Bench::odometry();
        if tf_first {
            bench.tf("base_link", "imu_link", 0, &base_from_imu(), true);
        }
        for step in 0..=10 {
            bench.pose(&imu_odometry(step));
        }
        if !tf_first {
            assert_eq!(bench.machine.counts().poses_in, 0, "they wait");
            bench.tf("base_link", "imu_link", 10, &base_from_imu(), true);
        }
        bench.cloud(base_cloud(START_NS + 5 * STEP_NS), START_NS + 10 * STEP_NS);
        let found = points(&bench.clouds[0])[0];
        assert!(
            (found - Vector3::new(1.05, 2.0, 3.0)).norm() < 1e-6,
            "{found}"
        );
        assert_eq!(bench.machine.counts().poses_in, 11);
    }
}

#[test]
fn a_pose_whose_mount_nobody_publishes_is_refused_by_name_and_remedy() {
    let mut bench = Bench::odometry();
    for step in 0..300 {
        bench.pose(&imu_odometry(step));
    }
    let counts = bench.machine.counts();
    assert!(
        counts.poses_no_transform > 100 && counts.poses_in == 0,
        "{counts:?}"
    );
    bench.cloud(base_cloud(START_NS), START_NS);
    bench.tick(START_NS + 5 * SECOND_NS);
    let refusals = bench.machine.refusals().all();
    let text = |reason| {
        let of = refusals.iter().find(|refusal| refusal.reason == reason);
        of.unwrap().text.clone()
    };
    for words in ["base_link <- imu_link", "ins.lever_arm_m", "base_frame"] {
        assert!(text("poses_no_transform").contains(words), "{words}");
        assert!(text("clouds_pose_late").contains(words), "{words}");
    }
}

#[test]
fn a_mount_by_parameters_holds_in_place_of_tf() {
    let mut options = TransformerOptions::new(InsSource::Odometry);
    let by_tf = base_from_imu();
    // Both by parameters while tf says otherwise, then each alone, the other by tf.
    for (lever_arm, boresight) in [(true, true), (true, false), (false, true)] {
        options.ins.lever_arm_m = lever_arm.then(Vector3::x);
        let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, FRAC_PI_2);
        options.ins.base_from_ins = boresight.then_some(turn);
        let mut bench = Bench::new(options.clone());
        let on_tf = match (lever_arm, boresight) {
            (true, true) => Isometry3::identity(),
            (true, false) => Isometry3::from_parts(Vector3::y().into(), by_tf.rotation),
            _ => Isometry3::from_parts(by_tf.translation, UnitQuaternion::identity()),
        };
        bench.tf("base_link", "imu_link", 0, &on_tf, true);
        bench.pose(&imu_odometry(3));
        let found = bench.machine.newest_pose().unwrap().map_from_base;
        assert!((found.to_homogeneous() - driven(3).to_homogeneous()).norm() < 1e-12);
    }
}

#[test]
fn a_pose_in_a_drifting_frame_is_brought_to_the_map() {
    let mut bench = Bench::odometry();
    let map_from_odom = Isometry3::new(Vector3::new(0.0, 7.0, 0.0), Vector3::z() * FRAC_PI_2);
    for step in 0..=4 {
        bench.tf("map", "odom", step, &map_from_odom, false);
        let mut message = odometry(START_NS + step * STEP_NS, &driven(step));
        message.header.frame_id = "odom".into();
        bench.pose(&message);
    }
    let found = bench.machine.newest_pose().unwrap().map_from_base;
    let expected = map_from_odom * driven(4);
    assert!((found.to_homogeneous() - expected.to_homogeneous()).norm() < 1e-12);
}

#[test]
fn a_frame_that_nothing_connects_with_the_map_is_the_map() {
    let mut bench = Bench::odometry();
    for step in 0..=200 {
        let mut message = odometry(START_NS + step * STEP_NS, &driven(step));
        message.header.frame_id = "camera_init".into();
        bench.pose(&message);
    }
    assert_eq!(bench.machine.counts().poses_in, 201);
    let found = bench.machine.newest_pose().unwrap().map_from_base;
    assert_eq!(found.translation.vector.x, driven(200).translation.vector.x);
    // Connected too late: the map stays one.
    bench.tf("map", "camera_init", 200, &driven(500), false);
    let mut message = odometry(START_NS + 201 * STEP_NS, &driven(201));
    message.header.frame_id = "camera_init".into();
    bench.pose(&message);
    let found = bench.machine.newest_pose().unwrap().map_from_base;
    assert_eq!(found.translation.vector.x, driven(201).translation.vector.x);
}

#[test]
fn a_map_frame_that_is_asked_for_needs_a_transform() {
    let mut bench = Bench::new(TransformerOptions {
        map_frame_is_given: true,
        ..TransformerOptions::new(InsSource::Odometry)
    });
    for step in 0..=200 {
        if step == 150 {
            bench.tf("map", "odom", step, &Isometry3::identity(), false);
        }
        let mut message = odometry(START_NS + step * STEP_NS, &driven(step));
        message.header.frame_id = "odom".into();
        bench.pose(&message);
    }
    let counts = bench.machine.counts();
    assert_eq!(
        (counts.poses_in, counts.poses_no_transform > 100),
        (1, true)
    );
    let text = &bench.machine.refusals().all()[0].text;
    assert!(
        text.contains("map <- odom") && text.contains("map_frame"),
        "{text}"
    );
}

#[test]
fn poses_with_and_without_covariance_are_of_the_machine_in_their_frame() {
    let expected = driven(9);
    let header = header("map", START_NS);
    let mut with = PoseWithCovarianceStamped {
        header: header.clone(),
        ..PoseWithCovarianceStamped::default()
    };
    with.pose.pose = pose(&expected);
    let without = PoseStamped {
        header,
        pose: pose(&expected),
    };
    for (source, message) in [
        (InsSource::Pose, InsMessage::Pose(&without)),
        (
            InsSource::PoseWithCovariance,
            InsMessage::PoseWithCovariance(&with),
        ),
    ] {
        let mut bench = Bench::new(TransformerOptions::new(source));
        bench.ins(message, START_NS);
        let found = bench.machine.newest_pose().unwrap().map_from_base;
        assert!((found.translation.vector - expected.translation.vector).norm() < 1e-12);
    }
}

/// A receiver at 1 Hz and an Imu at 100 Hz, each with a mount of its own, of a machine that drives north
/// at 2 m/s and turns.
#[test]
fn fixes_each_second_and_attitudes_between_give_poses_of_the_machine() {
    let origin = Geodetic::from_degrees(49.0, 8.4, 116.0).unwrap();
    let frame = EnuFrame::new(origin);
    let mut options = TransformerOptions::new(InsSource::NavsatfixImu);
    options.ins.origin = Some(origin);
    let mut bench = Bench::new(options);
    let antenna_m = Vector3::new(-0.5, 0.2, 1.5);
    let base_from_antenna = Isometry3::from_parts(antenna_m.into(), Default::default());
    bench.tf("base_link", "gps", 0, &base_from_antenna, true);
    let half_turn = Isometry3::rotation(Vector3::z() * std::f64::consts::PI);
    bench.tf("base_link", "imu_link", 0, &half_turn, true);
    let driven = |step: i64| {
        let seconds = step as f64 * 0.01;
        Isometry3::new(Vector3::new(0.0, 2.0 * seconds, 0.0), Vector3::z() * 0.1)
    };
    for step in 0..=300 {
        let (stamp_ns, truth) = (START_NS + step * STEP_NS, driven(step));
        if step % 100 == 0 {
            let place = frame.geodetic_from_enu(&(truth * base_from_antenna).translation.vector);
            let place = place.unwrap();
            let mut fix = NavSatFix {
                header: header("gps", stamp_ns),
                latitude: place.latitude_deg(),
                longitude: place.longitude_deg(),
                altitude: place.height_m,
                ..NavSatFix::default()
            };
            fix.status.status = 0;
            bench.ins(InsMessage::Fix(&fix), stamp_ns);
        }
        let imu = Imu {
            header: header("imu_link", stamp_ns),
            orientation: pose(&(truth * half_turn)).orientation,
            ..Imu::default()
        };
        bench.ins(InsMessage::Imu(&imu), stamp_ns);
        if step == 150 {
            bench.cloud(base_cloud(stamp_ns), stamp_ns);
        }
    }
    assert_eq!(bench.machine.counts().poses_in, 301);
    let found = points(&bench.clouds[0])[0];
    let expected = driven(150) * nalgebra::Point3::new(1.0, 2.0, 3.0);
    assert!((found - expected.coords).norm() < 1e-4, "{found}");
}

#[test]
fn the_mount_of_another_base_is_named_with_the_parameter_that_takes_it() {
    let mut bench = Bench::odometry();
    bench.drive(0, 10);
    bench.tf("body", "os_lidar", 0, &Isometry3::identity(), true);
    let mut cloud = base_cloud(START_NS);
    cloud.header.frame_id = "os_lidar".into();
    bench.cloud(cloud, START_NS);
    bench.tick(START_NS + 5 * SECOND_NS);
    let refusal = &bench.machine.refusals().all()[0];
    assert_eq!(refusal.reason, "clouds_no_mount");
    let expected =
        "no transform base_link <- os_lidar; tf has body <- os_lidar: try `-p base_frame:=body`";
    assert_eq!(refusal.text, expected);
}
