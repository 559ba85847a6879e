//! Poses from the messages of an INS.

use lattice_core::geodesy::{EnuFrame, Geodetic};
use lattice_msgs::novatel_oem7_msgs::{INSPVAX, InertialSolutionStatus};
use lattice_msgs::sensor_msgs::{Imu, NavSatFix};
use lattice_nodes::enu_transformer::TransformerOptions;
use lattice_nodes::enu_transformer::ins::{InsMessage, InsSource};
use lattice_test::clouds::{SECOND_NS, header, odometry, pose};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use super::{Bench, START_NS, STEP_NS};

#[test]
fn poses_without_meaning_are_refused() {
    let mut bench = Bench::odometry();
    let mut bad = odometry(START_NS, &Isometry3::identity());
    bad.pose.pose.position.x = f64::NAN;
    bench.pose(&bad);
    bad.pose.pose = pose(&Isometry3::identity());
    bad.pose.pose.orientation.w = 0.0;
    bench.pose(&bad);
    assert_eq!(bench.machine.counts().poses_invalid, 2);
    assert_eq!(bench.machine.counts().poses_in, 0);
}

#[test]
fn poses_are_refused_and_counted_by_reason() {
    let mut bench = Bench::odometry();
    bench.drive(0, 20);
    let at = |step: i64, east_m: f64| {
        let place = Isometry3::translation(east_m, 0.0, 0.0);
        odometry(START_NS + step * STEP_NS, &place)
    };
    // The stamp of the last one, again.
    bench.pose(&at(19, 0.19));
    // A kilometre away for a moment.
    bench.pose(&at(20, 1000.0));
    bench.drive(21, 40);
    let counts = bench.machine.counts();
    assert_eq!((counts.poses_in, counts.poses_out_of_order), (39, 1));
    assert_eq!((counts.poses_too_fast, counts.place_jumps), (1, 0));
    // And for longer than half a second.
    for step in 40..100 {
        bench.pose(&at(step, 1000.0));
    }
    let counts = bench.machine.counts();
    assert_eq!((counts.poses_in, counts.poses_too_fast), (99, 1));
    assert_eq!((counts.place_jumps, counts.poses_refused()), (1, 2));
}

const PLACE_M: Vector3<f64> = Vector3::new(300.0, -200.0, 4.0);

/// A place some way from the origin, and how a machine stands there.
fn place() -> (Geodetic, EnuFrame, UnitQuaternion<f64>) {
    let origin = Geodetic::from_degrees(-27.5, 153.0, 80.0).unwrap();
    let frame = EnuFrame::new(origin);
    let place = frame.geodetic_from_enu(&PLACE_M).unwrap();
    let attitude = UnitQuaternion::from_euler_angles(0.05, -0.1, 2.0);
    (place, frame, attitude)
}

#[test]
fn inspvax_gives_the_pose_of_the_machine_not_of_the_ins() {
    let (place, frame, level_from_base) = place();
    let lever_arm_m = Vector3::new(-0.35, 0.12, 1.25);
    let mut options = TransformerOptions::new(InsSource::Inspvax);
    options.ins.origin = Some(*frame.origin());
    options.ins.lever_arm_m = Some(lever_arm_m);
    options.ins.base_from_ins = Some(UnitQuaternion::identity());
    let mut bench = Bench::new(options);
    let (roll, pitch, yaw) = level_from_base.euler_angles();
    let mut message = INSPVAX {
        header: header("gps", 5),
        latitude: place.latitude_deg(),
        longitude: place.longitude_deg(),
        height: place.height_m - 42.0,
        undulation: 42.0,
        roll: roll.to_degrees(),
        pitch: -pitch.to_degrees(),
        azimuth: 90.0 - yaw.to_degrees(),
        ..INSPVAX::default()
    };
    message.nov_header.gps_week_number = 2400;
    message.nov_header.gps_week_milliseconds = 18_010;
    bench.ins(InsMessage::Inspvax(&message), 0);
    let inactive = bench.machine.counts().poses_not_good;
    assert_eq!(inactive, 1, "status 0 is inactive");
    message.ins_status.status = InertialSolutionStatus::INS_SOLUTION_GOOD;
    bench.ins(InsMessage::Inspvax(&message), 0);
    let pose = bench.machine.newest_pose().unwrap().map_from_base;
    let rotation = frame.enu_from_local_level(&place) * level_from_base;
    let expected_m = PLACE_M - rotation * lever_arm_m;
    assert!((pose.translation.vector - expected_m).norm() < 1e-6);
    assert!(pose.rotation.angle_to(&rotation) < 1e-9);
    // 2400 weeks after 1980-01-06, ten milliseconds, UTC.
    let stamp_ns = bench.transforms[0].header.stamp.to_ns();
    let week_ns = (315_964_800 + 2400 * 604_800) * SECOND_NS;
    assert_eq!(stamp_ns, week_ns + 10_000_000);
}

#[test]
fn a_fix_is_paired_with_the_attitude_at_its_stamp() {
    let (place, frame, level_from_base) = place();
    let mut options = TransformerOptions::new(InsSource::NavsatfixImu);
    options.ins.lever_arm_m = Some(Vector3::zeros());
    options.ins.base_from_ins = Some(UnitQuaternion::identity());
    options.ins.origin = Some(*frame.origin());
    let mut bench = Bench::new(options);
    let mut fix = NavSatFix {
        header: header("gps", START_NS + STEP_NS / 2),
        latitude: place.latitude_deg(),
        longitude: place.longitude_deg(),
        altitude: place.height_m,
        ..NavSatFix::default()
    };
    fix.status.status = 0;
    bench.ins(InsMessage::Fix(&fix), START_NS);
    assert_eq!(bench.machine.counts().poses_in, 0, "no attitude yet");
    let imu = |stamp_ns, sign| {
        let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, sign * 0.01);
        let mut imu = Imu {
            header: header("imu", stamp_ns),
            ..Imu::default()
        };
        let rotation = Isometry3::from_parts(Vector3::zeros().into(), turn * level_from_base);
        imu.orientation = pose(&rotation).orientation;
        imu
    };
    for (stamp_ns, sign) in [(START_NS, -1.0), (START_NS + STEP_NS, 1.0)] {
        bench.ins(InsMessage::Imu(&imu(stamp_ns, sign)), stamp_ns);
    }
    let found = bench.machine.newest_pose().unwrap().map_from_base;
    let rotation = frame.enu_from_local_level(&place) * level_from_base;
    assert!((found.translation.vector - PLACE_M).norm() < 1e-6);
    assert!(found.rotation.angle_to(&rotation) < 1e-6);
}

#[test]
fn an_imu_without_orientation_and_a_receiver_without_fix_give_no_pose() {
    let mut bench = Bench::new(TransformerOptions::new(InsSource::NavsatfixImu));
    let mut imu = Imu::default();
    imu.orientation_covariance[0] = -1.0;
    bench.machine.on_ins("ins", InsMessage::Imu(&imu), 0);
    let mut fix = NavSatFix::default();
    for status in [-1, -2] {
        fix.status.status = status;
        bench.machine.on_ins("ins", InsMessage::Fix(&fix), 0);
    }
    assert_eq!(bench.machine.counts().poses_not_good, 3);
}
