//! Clouds: waiting for poses, dropped by reason, deskewed, malformed.

use lattice_msgs::sensor_msgs::{PointCloud2, PointField};
use lattice_nodes::enu_transformer::TransformerOptions;
use lattice_nodes::enu_transformer::ins::{InsMessage, InsSource};
use lattice_test::clouds::{SECOND_NS, cloud, field, odometry, points, timed_cloud};
use nalgebra::Vector3;
use serde_bytes::ByteBuf;

use super::{Bench, START_NS, STEP_NS, base_cloud, driven};

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
}

#[test]
fn clouds_before_any_pose_are_dropped_and_counted() {
    let mut bench = Bench::odometry();
    bench.cloud(base_cloud(START_NS), START_NS);
    bench.tick(START_NS + SECOND_NS / 2);
    assert_eq!(bench.machine.waiting(), 1);
    bench.tick(START_NS + 2 * SECOND_NS);
    assert_eq!(bench.machine.counts().clouds_pose_late, 1);
    assert_eq!(bench.machine.waiting(), 0);
    bench.drive(0, 10);
    bench.cloud(base_cloud(START_NS - SECOND_NS), START_NS);
    assert_eq!(bench.machine.waiting(), 1, "the clock may have been set");
    bench.drive(10, 11);
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
    let after = base_cloud(START_NS + 650 * STEP_NS);
    bench.cloud(after, START_NS + 7 * SECOND_NS);
    assert_eq!(bench.clouds.len(), 1);
}

#[test]
fn a_log_that_loops_is_noticed_and_goes_on() {
    let mut bench = Bench::odometry();
    for _ in 0..3 {
        bench.drive(0, 1000);
        let last = base_cloud(START_NS + 995 * STEP_NS);
        bench.cloud(last, START_NS + 1000 * STEP_NS);
    }
    assert_eq!(bench.clouds.len(), 3);
    assert_eq!(bench.machine.counts().time_jumps, 2);
}

#[test]
fn a_pose_from_another_year_costs_no_cloud() {
    let mut bench = Bench::odometry();
    bench.drive(0, 10);
    for wrong_ns in [START_NS + 31_557_600 * SECOND_NS, 0] {
        let wrong = odometry(wrong_ns, &driven(0));
        bench.ins(InsMessage::Odometry(&wrong), START_NS + 9 * STEP_NS);
        bench.cloud(base_cloud(START_NS + 5 * STEP_NS), START_NS + 9 * STEP_NS);
    }
    assert_eq!(bench.clouds.len(), 2);
    bench.drive(10, 11);
    let counts = bench.machine.counts();
    assert_eq!((counts.poses_stamp_jump, counts.time_jumps), (2, 0));
    assert_eq!(bench.transforms.len(), 11);
}

#[test]
fn a_clock_that_jumps_back_lets_waiting_clouds_go() {
    let mut bench = Bench::odometry();
    bench.drive(0, 10);
    bench.cloud(base_cloud(START_NS + SECOND_NS), START_NS + SECOND_NS);
    assert_eq!(bench.machine.waiting(), 1);
    bench.tick(START_NS - 10 * SECOND_NS);
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
    lie(&|m| m.data = ByteBuf::from(vec![0; 5]));
    lie(&|m| m.fields.clear());
    lie(&|m| m.fields[2].name = "w".into());
    lie(&|m| m.fields[0].offset = u32::MAX - 1);
    lie(&|m| m.fields[0].datatype = 77);
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
    let numbers = [1.0_f64, 2.0, 3.0].map(f64::to_be_bytes).concat();
    let data = [&[0xff; 3][..], &numbers, &[0xff; 5]].concat();
    let mut message = cloud("base_link", START_NS, &[]);
    let fields = [("z", 19), ("y", 11), ("x", 3)];
    message.fields = fields.map(|(name, offset)| field(name, offset, 8)).into();
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
    assert_eq!(counts.points_not_finite, 2);
    assert_eq!(counts.points_out_of_range, 2);
}

#[test]
fn points_without_a_time_are_left_out_and_counted() {
    let mut bench = Bench::odometry();
    bench.drive(0, 10);
    let mut message = timed_cloud("base_link", START_NS, &[([1.0, 0.0, 0.0], 0); 3]);
    message.fields[3].datatype = PointField::FLOAT32;
    let middle = message.point_step as usize;
    message.data[middle + 12..middle + 16].copy_from_slice(&f32::NAN.to_le_bytes());
    bench.cloud(message, START_NS);
    let counts = bench.machine.counts();
    assert_eq!((counts.points_out, counts.points_no_time), (2, 1));
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
fn ranges_limits_and_fields_can_be_changed_while_it_works() {
    let options = || TransformerOptions::new(InsSource::Odometry);
    let mut bench = Bench::new(options());
    bench.drive(0, 10);
    let scan = || cloud("base_link", START_NS, &[[1.0, 0.0, 0.0], [100.0, 0.0, 0.0]]);
    bench.cloud(scan(), START_NS);
    bench.machine.set_options(TransformerOptions {
        max_range_m: 50.0,
        viewpoints: true,
        max_waiting_clouds: 2,
        ..options()
    });
    bench.cloud(scan(), START_NS);
    let widths: Vec<u32> = bench.clouds.iter().map(|cloud| cloud.width).collect();
    assert_eq!(widths, [2, 1]);
    assert_eq!(
        bench.clouds[1].fields.len(),
        bench.clouds[0].fields.len() + 3
    );
    for _ in 0..5 {
        bench.cloud(base_cloud(START_NS + SECOND_NS), START_NS);
    }
    assert_eq!(bench.machine.waiting(), 2);
}
