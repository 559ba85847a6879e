//! Tests of the whole simulation.

use super::bobcat::{INS_PERIOD_NS, SimulationError};
use super::lms200::Lms200Return;
use super::*;
use nalgebra::{Point3, Vector3};

fn bobcat(seed: u64) -> Bobcat {
    Bobcat::new(seed, 40.0).unwrap()
}

fn every(laser: Laser, bobcat: &Bobcat, step: usize) -> Vec<Lms200Scan> {
    (0..bobcat.scan_count(laser))
        .step_by(step)
        .map(|i| bobcat.scan(laser, i))
        .collect()
}

fn range_m(hit: &Lms200Return) -> f64 {
    Vector3::from(hit.point_m).cast::<f64>().norm()
}

/// Measured less true range of a return.
fn range_error_m(bobcat: &Bobcat, laser: Laser, scan: &Lms200Scan, hit: &Lms200Return) -> f64 {
    let time_ns = scan.start_ns + i64::from(hit.offset_ns);
    let origin = (bobcat.map_from_base(time_ns) * bobcat.base_from_laser(laser, time_ns))
        .translation
        .vector;
    range_m(hit) - (hit.truth_m - origin).norm()
}

#[test]
fn returns_are_like_those_of_the_real_machine() {
    let bobcat = Bobcat::new(1, 500.0).unwrap();
    let (mut scans, mut returns, mut ranges_m) = (0usize, 0usize, 0.0);
    for laser in Laser::ALL {
        let (mut own_scans, mut own_returns) = (0, 0);
        for scan in every(laser, &bobcat, 97) {
            own_scans += 1;
            own_returns += scan.returns.len();
            ranges_m += scan.returns.iter().map(range_m).sum::<f64>();
        }
        assert!(own_returns > 60 * own_scans, "{laser:?}: {own_returns}");
        scans += own_scans;
        returns += own_returns;
    }
    let (per_scan, mean_m) = (returns as f64 / scans as f64, ranges_m / returns as f64);
    assert!((85.0..100.0).contains(&per_scan), "{per_scan}");
    assert!((4.8..6.2).contains(&mean_m), "{mean_m}");
}

#[test]
fn range_noise_has_the_stated_deviation() {
    let bobcat = bobcat(5);
    let (mut n, mut sum, mut squares) = (0usize, 0.0, 0.0);
    for laser in Laser::ALL {
        for scan in every(laser, &bobcat, 23) {
            for hit in &scan.returns {
                let error_m = range_error_m(&bobcat, laser, &scan, hit);
                assert!(error_m.abs() < 7.0 * RANGE_NOISE_M, "{error_m} m");
                n += 1;
                sum += error_m;
                squares += error_m * error_m;
            }
        }
    }
    let mean_m = sum / n as f64;
    assert!(mean_m.abs() < 3e-4, "mean {mean_m} over {n}");
    let sigma_m = (squares / n as f64 - mean_m * mean_m).sqrt();
    assert!((sigma_m / RANGE_NOISE_M - 1.0).abs() < 0.02, "{sigma_m} m");
}

#[test]
fn true_points_lie_on_surfaces_and_measured_ones_on_their_beams() {
    let bobcat = bobcat(2);
    for laser in Laser::ALL {
        for scan in every(laser, &bobcat, 111) {
            for hit in &scan.returns {
                assert!(bobcat.site().surface_distance_m(&hit.truth_m) < 1e-6);
                let time_ns = scan.start_ns + i64::from(hit.offset_ns);
                let map_from_laser =
                    bobcat.map_from_base(time_ns) * bobcat.base_from_laser(laser, time_ns);
                let truth = map_from_laser.inverse() * Point3::from(hit.truth_m);
                let measured = Vector3::from(hit.point_m).cast::<f64>();
                assert!(truth.coords.normalize().cross(&measured.normalize()).norm() < 1e-6);
                assert!((MIN_RANGE_M - 1e-6..=MAX_RANGE_M + 1e-5).contains(&measured.norm()));
                assert!((0.0..=255.0).contains(&hit.intensity));
            }
        }
    }
}

#[test]
fn another_seed_changes_the_noise_but_not_the_tour() {
    let (a, b) = (bobcat(1), bobcat(2));
    assert_ne!(a.scan(Laser::Left, 3), b.scan(Laser::Left, 3));
    let [at, other] = [&a, &b].map(|bobcat| bobcat.map_from_base(9_000_000_000).translation.vector);
    assert!((at - other).norm() < 0.02);
    assert_ne!(at, other);
    assert!(a.ins().next() != b.ins().next());
}

#[test]
fn the_top_mount_moves_without_a_jump_and_half_a_turn_per_second() {
    let bobcat = bobcat(1);
    let step_ns = 1_000_000;
    let mut before = bobcat.base_from_laser(Laser::Top, 0);
    for i in 1..5_000 {
        let now = bobcat.base_from_laser(Laser::Top, i * step_ns);
        let turned_rad = (before.rotation.inverse() * now.rotation).angle();
        assert!((turned_rad - std::f64::consts::PI * 1e-3).abs() < 1e-9);
        assert!((now.translation.vector - before.translation.vector).norm() < 1e-3);
        before = now;
    }
    let turned = bobcat.base_from_turntable(500_000_000).rotation * Vector3::x();
    assert!((turned - Vector3::y()).norm() < 1e-12, "counter-clockwise");
}

#[test]
fn side_lasers_look_ahead_and_outwards() {
    for (laser, sign) in [(Laser::Left, 1.0), (Laser::Right, -1.0)] {
        let mount = laser.mount();
        let middle = mount.rotation * Vector3::x();
        assert!(middle.x > 0.2 && sign * middle.y > 0.8 && middle.z.abs() < 1e-12);
        let first = mount.rotation * -Vector3::y();
        assert!(
            first.z < -0.9 && first.x > 0.2,
            "not down and ahead: {first:?}"
        );
    }
}

#[test]
fn every_beam_lies_between_two_ins_epochs() {
    for duration_s in [0.1, 0.5, 1.234_567, 30.0] {
        let bobcat = Bobcat::new(1, duration_s).unwrap();
        let last_ns = bobcat.ins().last().unwrap().time_ns;
        assert!(last_ns <= bobcat.end_ns() && bobcat.end_ns() - last_ns < INS_PERIOD_NS);
        for laser in Laser::ALL {
            let count = bobcat.scan_count(laser);
            assert!(count > 0);
            assert!(bobcat.scan_start_ns(laser, count - 1) + SCAN_SPAN_NS < last_ns);
            assert!(bobcat.scan_start_ns(laser, count) + SCAN_SPAN_NS + 1 >= last_ns);
            assert!(bobcat.scan_start_ns(laser, 0) > 0);
        }
        let [first_ns, last_ns] = [0, 75].map(|i| bobcat.scan_start_ns(Laser::Left, i));
        assert_eq!(last_ns - first_ns, 1_000_000_000);
    }
}

#[test]
fn measured_poses_follow_the_mount_and_stay_near_the_truth() {
    let bobcat = bobcat(4);
    for sample in bobcat.ins().step_by(50) {
        let base = sample.map_from_imu * base_from_imu().inverse();
        assert!((base.translation.vector - sample.map_from_base.translation.vector).norm() < 1e-12);
        let truth = bobcat.map_from_base(sample.time_ns);
        assert_eq!(sample.true_map_from_base, truth);
        let error = truth.inverse() * sample.map_from_base;
        assert!(error.translation.vector.norm() < 0.15, "{error}");
        assert!(error.rotation.angle().to_degrees() < 0.5, "{error}");
    }
}

#[test]
fn velocities_are_those_of_the_tour() {
    let bobcat = bobcat(4);
    let samples: Vec<_> = bobcat.ins().collect();
    let (mut squares, mut n) = (0.0, 0.0);
    for triple in samples.windows(3).step_by(7) {
        let [before, at, after] = triple else {
            unreachable!()
        };
        let step_s = 1e-9 * (after.time_ns - before.time_ns) as f64;
        let (from, to) = (before.true_map_from_base, after.true_map_from_base);
        let moved_mps = (to.translation.vector - from.translation.vector) / step_s;
        let velocity_mps = at.true_map_from_base.rotation * at.base_velocity_mps;
        squares += (velocity_mps - moved_mps).norm_squared();
        n += 3.0;
        let turned = (from.rotation.inverse() * to.rotation).scaled_axis() / step_s;
        assert!((turned - at.base_turn_rate_radps).norm() < 0.06, "{turned}");
    }
    let sigmas = f64::sqrt(squares / n) / InsSample::VELOCITY_SIGMA_MPS;
    assert!((sigmas - 1.0).abs() < 0.1, "{sigmas}");
}

#[test]
fn ins_messages_arrive_in_order_some_milliseconds_late() {
    let delays: Vec<i64> = bobcat(4).ins().map(|sample| sample.delay_ns).collect();
    let late = 2_000_000..INS_PERIOD_NS;
    assert!(delays.iter().all(|delay_ns| late.contains(delay_ns)));
    let mean_ns = delays.iter().sum::<i64>() as f64 / delays.len() as f64;
    assert!((3.3e6..3.7e6).contains(&mean_ns), "{mean_ns} ns");
    assert!(delays.iter().max() > Some(&6_000_000));
}

#[test]
fn refuses_absurd_durations() {
    for duration_s in [f64::NAN, f64::INFINITY, -1.0, 0.0, 1e9] {
        assert!(matches!(
            Bobcat::new(0, duration_s),
            Err(SimulationError::Duration { .. })
        ));
    }
}
