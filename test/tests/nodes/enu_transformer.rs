//! The transformer's logic: waiting, dropping by reason, deskew, and hostile input.

use std::sync::Arc;

use lattice_core::geodesy::{EnuFrame, Geodetic, InsMount};
use lattice_msgs::geometry_msgs::TransformStamped;
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::novatel_oem7_msgs::{INSPVAX, InertialSolutionStatus};
use lattice_msgs::sensor_msgs::{Imu, NavSatFix, PointCloud2};
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_nodes::convert::geometry::transform_stamped;
use lattice_nodes::enu_transformer::ins::{InsMessage, InsSource};
use lattice_nodes::enu_transformer::{EnuOutput, EnuTransformer, TransformerOptions};
use lattice_test::clouds::{SECOND_NS, cloud, field, header, odometry, points, pose, timed_cloud};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use serde_bytes::ByteBuf;

/// Time of the first pose.
const START_NS: i64 = 1_700_000_000 * SECOND_NS;
const STEP_NS: i64 = SECOND_NS / 100;

struct Bench {
    machine: EnuTransformer,
    clouds: Vec<Arc<PointCloud2>>,
    transforms: Vec<TransformStamped>,
}

impl Bench {
    fn new(options: TransformerOptions) -> Self {
        Self {
            machine: EnuTransformer::new(options),
            clouds: Vec::new(),
            transforms: Vec::new(),
        }
    }

    fn odometry() -> Self {
        Self::new(TransformerOptions::new(InsSource::Odometry))
    }

    fn take(&mut self, outputs: Vec<EnuOutput>) {
        for output in outputs {
            match output {
                EnuOutput::Points(points) => self.clouds.push(points),
                EnuOutput::Transform(transform) => self.transforms.push(transform),
                EnuOutput::StaticTransform(_) | EnuOutput::Origin(_) => {}
            }
        }
    }

    /// A pose received at its own time.
    fn pose(&mut self, message: &Odometry) {
        let now_ns = message.header.stamp.to_ns();
        let outputs = self.machine.on_ins(InsMessage::Odometry(message), now_ns);
        self.take(outputs);
    }

    /// Poses of a machine that drives east at 1 m/s, from `from` steps to `to` steps.
    fn drive(&mut self, from: i64, to: i64) {
        for step in from..to {
            self.pose(&odometry(START_NS + step * STEP_NS, &driven(step)));
        }
    }

    fn cloud(&mut self, message: PointCloud2, now_ns: i64) {
        let outputs = self.machine.on_cloud(Arc::new(message), now_ns);
        self.take(outputs);
    }
}

fn driven(step: i64) -> Isometry3<f64> {
    Isometry3::translation(step as f64 * 0.01, 0.0, 0.0)
}

fn base_cloud(stamp_ns: i64) -> PointCloud2 {
    cloud("base_link", stamp_ns, &[[1.0, 2.0, 3.0]])
}

#[test]
fn a_cloud_between_two_poses_is_interpolated() {
    let mut bench = Bench::odometry();
    bench.drive(0, 10);
    bench.cloud(base_cloud(START_NS + 5 * STEP_NS / 2), START_NS);
    assert_eq!(bench.clouds.len(), 1);
    assert_eq!(bench.clouds[0].header.frame_id, "map");
    let out = points(&bench.clouds[0]);
    assert!((out[0] - Vector3::new(1.025, 2.0, 3.0)).norm() < 1e-6);
    assert_eq!(bench.transforms.len(), 10);
    assert_eq!(bench.transforms[9].child_frame_id, "base_link");
}

#[test]
fn a_cloud_waits_for_the_pose_that_covers_it() {
    let mut bench = Bench::odometry();
    bench.drive(0, 3);
    bench.cloud(base_cloud(START_NS + 5 * STEP_NS), START_NS);
    assert!(bench.clouds.is_empty());
    bench.drive(3, 5);
    assert!(bench.clouds.is_empty(), "nothing is extrapolated");
    bench.drive(5, 6);
    assert_eq!(bench.clouds.len(), 1);
    assert_eq!(bench.machine.counts().clouds_dropped(), 0);
}

#[test]
fn clouds_before_any_pose_are_dropped_and_counted() {
    let mut bench = Bench::odometry();
    bench.cloud(base_cloud(START_NS), START_NS);
    bench.take(Vec::new());
    let outputs = bench.machine.tick(START_NS + SECOND_NS / 2);
    bench.take(outputs);
    assert_eq!(bench.machine.waiting(), 1);
    let outputs = bench.machine.tick(START_NS + 2 * SECOND_NS);
    bench.take(outputs);
    assert_eq!(bench.machine.counts().clouds_pose_late, 1);
    assert_eq!(bench.machine.waiting(), 0);
    bench.drive(0, 10);
    bench.cloud(base_cloud(START_NS - SECOND_NS), START_NS);
    assert_eq!(bench.machine.counts().clouds_before_poses, 1);
    bench.cloud(base_cloud(START_NS + STEP_NS), START_NS);
    assert_eq!(bench.clouds.len(), 1, "the next good cloud passes");
}

#[test]
fn a_gap_of_five_seconds_in_the_ins_is_not_bridged() {
    let mut bench = Bench::odometry();
    bench.drive(0, 100);
    let inside_ns = START_NS + 3 * SECOND_NS;
    bench.cloud(base_cloud(inside_ns), START_NS + 6 * SECOND_NS);
    bench.drive(600, 700);
    bench.cloud(base_cloud(inside_ns), START_NS + 7 * SECOND_NS);
    let counts = bench.machine.counts();
    assert_eq!(counts.clouds_pose_gap + counts.clouds_pose_late, 2);
    assert!(counts.clouds_pose_gap >= 1);
    assert!(bench.clouds.is_empty());
    bench.cloud(
        base_cloud(START_NS + 650 * STEP_NS),
        START_NS + 7 * SECOND_NS,
    );
    assert_eq!(bench.clouds.len(), 1);
}

#[test]
fn a_log_that_loops_is_noticed_and_goes_on() {
    let mut bench = Bench::odometry();
    for _ in 0..3 {
        bench.drive(0, 1000);
        bench.cloud(
            base_cloud(START_NS + 995 * STEP_NS),
            START_NS + 1000 * STEP_NS,
        );
    }
    assert_eq!(bench.clouds.len(), 3);
    assert_eq!(bench.machine.counts().time_jumps, 2);
}

#[test]
fn a_clock_that_jumps_back_lets_waiting_clouds_go() {
    let mut bench = Bench::odometry();
    bench.drive(0, 10);
    bench.cloud(base_cloud(START_NS + SECOND_NS), START_NS + SECOND_NS);
    assert_eq!(bench.machine.waiting(), 1);
    let outputs = bench.machine.tick(START_NS - 10 * SECOND_NS);
    bench.take(outputs);
    assert_eq!(bench.machine.counts().clouds_time_jump, 1);
}

#[test]
fn each_point_is_moved_to_its_own_time() {
    let mut bench = Bench::odometry();
    bench.drive(0, 20);
    let timed = [([0.0_f32, 1.0, 0.0], 0_u32), ([0.0, 1.0, 0.0], 50_000_000)];
    bench.cloud(timed_cloud("base_link", START_NS, &timed), START_NS);
    let out = points(&bench.clouds[0]);
    assert!((out[0] - Vector3::new(0.0, 1.0, 0.0)).norm() < 1e-6);
    assert!((out[1] - Vector3::new(0.05, 1.0, 0.0)).norm() < 1e-6);
}

#[test]
fn a_turning_mount_is_followed() {
    let mut bench = Bench::odometry();
    bench.drive(0, 20);
    let quarter = |step: i64| {
        let angle = std::f64::consts::FRAC_PI_2 * step as f64 / 10.0;
        Isometry3::from_parts(
            Vector3::new(0.0, 0.0, 2.0).into(),
            UnitQuaternion::from_euler_angles(0.0, 0.0, angle),
        )
    };
    let at = |step| {
        transform_stamped(
            "base_link",
            "turntable",
            START_NS + step * STEP_NS,
            &quarter(step),
        )
    };
    let message = TFMessage {
        transforms: (0..=10).map(at).collect(),
    };
    let stamp_ns = START_NS;
    bench.cloud(
        timed_cloud("turntable", stamp_ns, &[([1.0, 0.0, 0.0], 100_000_000)]),
        stamp_ns,
    );
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
    let outputs = bench.machine.tick(START_NS + 5 * SECOND_NS);
    bench.take(outputs);
    assert_eq!(bench.machine.counts().clouds_no_mount, 1);
}

#[test]
fn malformed_clouds_are_refused_and_the_next_one_passes() {
    let mut bench = Bench::odometry();
    bench.drive(0, 10);
    let good = base_cloud(START_NS);
    let mut lies: Vec<PointCloud2> = Vec::new();
    let mut lie = |change: &dyn Fn(&mut PointCloud2)| {
        let mut message = good.clone();
        change(&mut message);
        lies.push(message);
    };
    lie(&|m| m.width = 1_000_000_000);
    lie(&|m| (m.width, m.height) = (u32::MAX, u32::MAX));
    lie(&|m| m.point_step = u32::MAX);
    lie(&|m| m.point_step = 0);
    lie(&|m| m.row_step = 3);
    lie(&|m| m.data = ByteBuf::from(vec![0; 5]));
    lie(&|m| m.fields.clear());
    lie(&|m| m.fields[2].name = "w".into());
    lie(&|m| m.fields[0].offset = u32::MAX - 1);
    lie(&|m| m.fields[0].datatype = 77);
    lie(&|m| m.fields[1].count = 0);
    let number = lies.len() as u64;
    for message in lies {
        bench.cloud(message, START_NS);
    }
    assert_eq!(bench.machine.counts().clouds_malformed, number);
    assert!(bench.clouds.is_empty());
    bench.cloud(good, START_NS);
    assert_eq!(bench.clouds.len(), 1);
}

#[test]
fn big_endian_padded_and_double_clouds_are_read() {
    let mut bench = Bench::odometry();
    bench.drive(0, 10);
    let mut data = vec![0xff; 3];
    for v in [1.0_f64, 2.0, 3.0] {
        data.extend(v.to_be_bytes());
    }
    data.extend([0xff; 5]);
    let mut message = cloud("base_link", START_NS, &[]);
    message.fields = ["z", "y", "x"]
        .into_iter()
        .zip([19, 11, 3])
        .map(|(name, offset)| field(name, offset, 8))
        .collect();
    (message.width, message.point_step, message.row_step) = (1, 28, 32);
    message.is_bigendian = true;
    message.data = ByteBuf::from(data);
    bench.cloud(message, START_NS);
    let out = points(&bench.clouds[0]);
    assert!((out[0] - Vector3::new(1.0, 2.0, 3.0)).norm() < 1e-6);
}

#[test]
fn points_without_meaning_are_left_out_by_reason() {
    let options = TransformerOptions {
        min_range_m: 0.5,
        max_range_m: 50.0,
        ..TransformerOptions::new(InsSource::Odometry)
    };
    let mut bench = Bench::new(options);
    bench.drive(0, 10);
    let scan = [
        [1.0, 0.0, 0.0],
        [f32::NAN, 0.0, 0.0],
        [0.0, f32::INFINITY, 0.0],
        [0.1, 0.0, 0.0],
        [100.0, 0.0, 0.0],
    ];
    bench.cloud(cloud("base_link", START_NS, &scan), START_NS);
    let counts = bench.machine.counts();
    assert_eq!((counts.points_in, counts.points_out), (5, 1));
    assert_eq!(
        (counts.points_not_finite, counts.points_out_of_range),
        (2, 2)
    );
}

#[test]
fn the_queue_of_waiting_clouds_is_bounded() {
    let options = TransformerOptions {
        max_waiting_clouds: 4,
        ..TransformerOptions::new(InsSource::Odometry)
    };
    let mut bench = Bench::new(options);
    for i in 0..10 {
        bench.cloud(base_cloud(START_NS + i), START_NS);
    }
    assert_eq!(bench.machine.waiting(), 4);
    assert_eq!(bench.machine.counts().clouds_queue_full, 6);
}

#[test]
fn poses_without_meaning_are_refused() {
    let mut bench = Bench::odometry();
    let mut bad = odometry(START_NS, &Isometry3::identity());
    bad.pose.pose.position.x = f64::NAN;
    bench.pose(&bad);
    bad.pose.pose = pose(&Isometry3::identity());
    bad.pose.pose.orientation = lattice_msgs::geometry_msgs::Quaternion {
        x: 0.0,
        y: 0.0,
        z: 0.0,
        w: 0.0,
    };
    bench.pose(&bad);
    assert_eq!(bench.machine.counts().poses_invalid, 2);
    assert_eq!(bench.machine.counts().poses_in, 0);
}

/// A place some way from the origin, and how a machine stands there.
fn place() -> (Geodetic, EnuFrame, UnitQuaternion<f64>) {
    let origin = Geodetic::from_degrees(-27.5, 153.0, 80.0).unwrap();
    let frame = EnuFrame::new(origin);
    let place = frame
        .geodetic_from_enu(&Vector3::new(300.0, -200.0, 4.0))
        .unwrap();
    (
        place,
        frame,
        UnitQuaternion::from_euler_angles(0.05, -0.1, 2.0),
    )
}

#[test]
fn inspvax_gives_the_pose_of_the_machine_not_of_the_ins() {
    let (place, frame, level_from_base) = place();
    let lever_arm_m = Vector3::new(-0.35, 0.12, 1.25);
    let mut options = TransformerOptions::new(InsSource::Inspvax);
    options.ins.origin = Some(*frame.origin());
    options.ins.mount = InsMount::new(lever_arm_m, [0.0; 3]);
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
    let outputs = bench.machine.on_ins(InsMessage::Inspvax(&message), 0);
    bench.take(outputs);
    assert_eq!(
        bench.machine.counts().poses_not_good,
        1,
        "status 0 is inactive"
    );
    message.ins_status.status = InertialSolutionStatus::INS_SOLUTION_GOOD;
    let outputs = bench.machine.on_ins(InsMessage::Inspvax(&message), 0);
    bench.take(outputs);
    let pose = bench.machine.newest_pose().unwrap().map_from_base;
    let rotation = frame.enu_from_local_level(&place) * level_from_base;
    let expected_m = Vector3::new(300.0, -200.0, 4.0) - rotation * lever_arm_m;
    assert!((pose.translation.vector - expected_m).norm() < 1e-6);
    assert!(pose.rotation.angle_to(&rotation) < 1e-9);
    // 2400 weeks after 1980-01-06, ten milliseconds, UTC.
    let stamp_ns = bench.transforms[0].header.stamp.to_ns();
    assert_eq!(
        stamp_ns,
        (315_964_800 + 2400 * 604_800) * SECOND_NS + 10_000_000
    );
}

#[test]
fn a_fix_is_paired_with_the_attitude_at_its_stamp() {
    let (place, frame, level_from_base) = place();
    let mut options = TransformerOptions::new(InsSource::NavsatfixImu);
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
    let outputs = bench.machine.on_ins(InsMessage::Fix(&fix), START_NS);
    bench.take(outputs);
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
        let outputs = bench
            .machine
            .on_ins(InsMessage::Imu(&imu(stamp_ns, sign)), stamp_ns);
        bench.take(outputs);
    }
    let found = bench.machine.newest_pose().unwrap().map_from_base;
    let rotation = frame.enu_from_local_level(&place) * level_from_base;
    assert!((found.translation.vector - Vector3::new(300.0, -200.0, 4.0)).norm() < 1e-6);
    assert!(found.rotation.angle_to(&rotation) < 1e-6);
}

#[test]
fn an_imu_without_orientation_and_a_receiver_without_fix_give_no_pose() {
    let mut bench = Bench::new(TransformerOptions::new(InsSource::NavsatfixImu));
    let mut imu = Imu::default();
    imu.orientation_covariance[0] = -1.0;
    bench.machine.on_ins(InsMessage::Imu(&imu), 0);
    let mut fix = NavSatFix::default();
    for status in [-1, -2] {
        fix.status.status = status;
        bench.machine.on_ins(InsMessage::Fix(&fix), 0);
    }
    assert_eq!(bench.machine.counts().poses_not_good, 3);
}
