use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::*;

mod check;
mod stamps;

/// Pseudorandom numbers from -1 to 1.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    /// Nearly normal numbers of variance 1.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| 0.5 * self.next()).sum()
    }
}

/// A drive of 20 s among walls.
#[derive(Clone, Copy, PartialEq)]
enum Drive {
    /// Turns on rough ground.
    Rough,
    /// Turns on flat ground.
    Flat,
    /// A straight line on flat ground.
    Straight,
}

fn pose_at(drive: Drive, time_s: f64) -> Isometry3<f64> {
    let (x, y, yaw) = match drive {
        Drive::Straight => (2.0 * time_s - 20.0, 0.0, 0.0),
        _ => {
            let yaw = 1.2 * (0.5 * time_s).sin() + 0.15 * time_s;
            (8.0 * (0.3 * time_s).sin(), 6.0 * (0.45 * time_s).cos(), yaw)
        }
    };
    let (z, roll, pitch) = match drive {
        Drive::Rough => (
            0.1 * (1.1 * time_s).sin(),
            0.06 * (0.9 * time_s).sin(),
            0.05 * (1.3 * time_s).cos(),
        ),
        _ => (0.0, 0.0, 0.0),
    };
    Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    )
}

/// Distance to ground, walls and blocks along a ray; infinite without.
fn distance_m(from: &Vector3<f64>, along: &Vector3<f64>) -> f64 {
    let mut nearest = f64::INFINITY;
    let mut hit = |t: f64, is_on: &dyn Fn(&Vector3<f64>) -> bool| {
        if t > 0.3 && t < nearest && is_on(&(from + along * t)) {
            nearest = t;
        }
    };
    hit(-(from.z + 0.5) / along.z, &|p| {
        p.x.abs() < 40.0 && p.y.abs() < 40.0
    });
    let boxes = [
        ([-28.0, -18.0], [28.0, 18.0], 6.0),
        ([12.0, -15.0], [15.0, -9.0], 3.0),
        ([-20.0, 9.0], [-14.0, 12.0], 2.0),
        ([14.0, 10.0], [20.0, 11.0], 4.0),
        ([-22.0, -14.0], [-18.0, -12.0], 3.0),
    ];
    for ([x0, y0], [x1, y1], top) in boxes {
        for x in [x0, x1] {
            hit((x - from.x) / along.x, &|p| {
                p.y > y0 && p.y < y1 && p.z > -0.5 && p.z < top
            });
        }
        for y in [y0, y1] {
            hit((y - from.y) / along.y, &|p| {
                p.x > x0 && p.x < x1 && p.z > -0.5 && p.z < top
            });
        }
        hit((top - from.z) / along.z, &|p| {
            top < 5.0 && p.x > x0 && p.x < x1 && p.y > y0 && p.y < y1
        });
    }
    nearest
}

/// Samples of a drive whose stated mount is wrong by `base_from_base` about the sensor, and whose stamps are late.
fn samples(drive: Drive, wrong: &MountCorrection, late_s: f64, seed: u64) -> MountSamples {
    let mut random = Random(seed);
    let sensor_m = wrong.sensor_m();
    let base_from_sensor = Isometry3::translation(sensor_m.x, sensor_m.y, sensor_m.z);
    let mut samples = MountSamples {
        sensor_m: wrong.sensor_m() - wrong.shift_m,
        ..MountSamples::default()
    };
    let stated_from_base = wrong.base_from_stated().inverse();
    for scan in 0..200 {
        let time_s = 0.1 * f64::from(scan);
        let pose = pose_at(drive, time_s);
        let at = |t: f64| pose_at(drive, t);
        let (stamped, before, after) = (
            at(time_s + late_s),
            at(time_s + late_s - 0.005),
            at(time_s + late_s + 0.005),
        );
        let turn = after.rotation * before.rotation.inverse();
        samples.poses.push(BasePose {
            stamp_s: time_s,
            map_from_base: stamped,
            velocity_m_per_s: (after.translation.vector - before.translation.vector) / 0.01,
            rate_rad_per_s: turn.scaled_axis() / 0.01,
        });
        for _ in 0..400 {
            let (azimuth, elevation) = (
                random.next() * std::f64::consts::PI,
                0.35 * random.next() - 0.1,
            );
            let along = Vector3::new(
                azimuth.cos() * elevation.cos(),
                azimuth.sin() * elevation.cos(),
                elevation.sin(),
            );
            let map_from_sensor = pose * base_from_sensor;
            let d = distance_m(
                &map_from_sensor.translation.vector,
                &(map_from_sensor.rotation * along),
            );
            if d > 50.0 {
                continue;
            }
            let point =
                base_from_sensor * nalgebra::Point3::from(along * (d + 0.01 * random.normal()));
            samples
                .points
                .push((scan as u32, (stated_from_base * point).coords));
        }
    }
    samples
}

/// A wrong mount of degrees and metres.
fn wrong(turn_deg: [f64; 3], shift_m: [f64; 3]) -> MountCorrection {
    let sensor_m = Vector3::new(0.4, 0.1, 1.5) - Vector3::from(shift_m);
    let mut vector = MountCorrection::identity(sensor_m).vector();
    for i in 0..3 {
        vector[i] = turn_deg[i].to_radians();
        vector[3 + i] = shift_m[i];
    }
    MountCorrection::identity(sensor_m).of(&vector)
}

/// Left error of the rotation in the base frame (deg), of the lever arm (m) and of the time (s).
fn errors(found: &MountEstimate, truth: &MountCorrection, late_s: f64) -> [f64; 7] {
    let turn = (found.correction.rotation * truth.rotation.inverse()).scaled_axis();
    let shift = found.correction.shift_m - truth.shift_m;
    let [a, b, c] = [turn.x, turn.y, turn.z].map(f64::to_degrees);
    [
        a,
        b,
        c,
        shift.x,
        shift.y,
        shift.z,
        found.correction.time_s + late_s,
    ]
}

fn observable(found: &MountEstimate) -> [bool; 7] {
    found.numbers.map(|number| number.is_observable)
}

/// Options for poses without errors: those of the default hide the height on ground this rough.
fn exact_poses() -> MountOptions {
    MountOptions {
        pose_sigma_m: 0.002,
        pose_sigma_rad: 1e-4,
        ..MountOptions::default()
    }
}

#[test]
fn a_wrong_mount_is_found_from_turns_on_rough_ground() {
    for (seed, turn, shift, late_s) in [
        (1, [0.0; 3], [0.0; 3], 0.0),
        (2, [2.0, -1.0, 3.0], [0.2, -0.1, 0.1], 0.02),
        (3, [-12.0, 10.0, -13.0], [-0.8, 0.6, 0.8], -0.03),
    ] {
        let truth = wrong(turn, shift);
        let samples = samples(Drive::Rough, &truth, late_s, seed);
        let found = estimate_mount(&samples, &exact_poses()).unwrap();
        assert_eq!(observable(&found), [true; 7]);
        let errors = errors(&found, &truth, late_s);
        for (i, (error, number)) in errors.iter().zip(found.numbers).enumerate() {
            let (limit, sigma) = match i {
                0..3 => (0.05, number.sigma.to_degrees()),
                3..6 => (0.02, number.sigma),
                _ => (0.001, number.sigma),
            };
            assert!(error.abs() < limit, "{i}: {errors:?}");
            assert!(
                error.abs() < 5.0 * sigma,
                "{i}: {errors:?} {:?}",
                found.numbers
            );
        }
        assert!(found.after.voxels as f64 <= 1.01 * found.before.voxels as f64);
    }
}

#[test]
fn flat_ground_does_not_show_the_height() {
    let truth = wrong([3.0, 2.0, -4.0], [0.3, 0.2, 0.4]);
    let samples = samples(Drive::Flat, &truth, 0.0, 4);
    let found = estimate_mount(&samples, &MountOptions::default()).unwrap();
    assert_eq!(
        observable(&found),
        [true, true, true, true, true, false, true]
    );
    let errors = errors(&found, &truth, 0.0);
    assert_eq!(found.correction.shift_m.z, 0.0);
    assert!(
        errors.iter().take(3).all(|error| error.abs() < 0.05),
        "{errors:?}"
    );
    assert!(
        errors
            .iter()
            .skip(3)
            .take(2)
            .all(|error| error.abs() < 0.02),
        "{errors:?}"
    );
}

#[test]
fn a_straight_way_shows_the_direction_of_travel_alone() {
    let truth = wrong([1.0, 2.0, -3.0], [0.2, 0.2, 0.3]);
    let samples = samples(Drive::Straight, &truth, 0.01, 5);
    let found = estimate_mount(&samples, &MountOptions::default()).unwrap();
    assert_eq!(
        observable(&found),
        [false, true, true, false, false, false, false]
    );
    assert_eq!(found.correction.shift_m, Vector3::zeros());
    let errors = errors(&found, &truth, 0.0);
    // A roll about the direction of travel remains.
    assert!(
        errors[1].abs() < 0.05 && errors[2].abs() < 0.05,
        "{errors:?}"
    );
}

#[test]
fn moving_things_do_not_decide() {
    let truth = wrong([-2.0, 3.0, 5.0], [0.1, -0.3, 0.2]);
    let mut samples = samples(Drive::Rough, &truth, 0.0, 6);
    // Things that follow the machine: in every scan at the same place of the base.
    let mut random = Random(6);
    for i in 0..samples.points.len() / 6 {
        let by = Vector3::new(random.next(), random.next(), random.next());
        samples.points[6 * i].1 = Vector3::new(3.0, 4.0, 0.8) + by;
    }
    let found = estimate_mount(&samples, &exact_poses()).unwrap();
    let errors = errors(&found, &truth, 0.0);
    assert!(
        errors.iter().take(3).all(|error| error.abs() < 0.1),
        "{errors:?}"
    );
    assert!(
        errors
            .iter()
            .skip(3)
            .take(3)
            .all(|error| error.abs() < 0.03),
        "{errors:?}"
    );
}

#[test]
fn what_cannot_be_estimated_is_refused() {
    let options = MountOptions::default();
    let truth = wrong([0.0; 3], [0.0; 3]);
    let empty = MountSamples::default();
    assert_eq!(
        estimate_mount(&empty, &options),
        Err(MountError::FewPoints { points: 0 })
    );
    let mut standing = samples(Drive::Rough, &truth, 0.0, 7);
    let first = standing.poses[0];
    standing.poses.fill(first);
    let found = estimate_mount(&standing, &options);
    assert!(
        matches!(found, Err(MountError::NoMotion { .. })),
        "{found:?}"
    );
    let mut hostile = samples(Drive::Flat, &truth, 0.0, 8);
    for (i, (pose, point)) in hostile.points.iter_mut().enumerate() {
        match i % 3 {
            0 => *pose = u32::MAX,
            1 => point.x = f64::NAN,
            _ => point.y = 1e300,
        }
    }
    let found = estimate_mount(&hostile, &options);
    assert!(
        matches!(found, Err(MountError::FewPlanes { .. })),
        "{found:?}"
    );
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(64))]

    #[test]
    fn corrections_are_their_vectors(
        turn in proptest::array::uniform3(-0.5..0.5_f64),
        shift in proptest::array::uniform3(-2.0..2.0_f64),
        sensor in proptest::array::uniform3(-3.0..3.0_f64),
    ) {
        let sensor_m = Vector3::from(sensor);
        let mut vector = MountCorrection::identity(sensor_m).vector();
        for i in 0..3 {
            vector[i] = turn[i];
            vector[3 + i] = shift[i];
        }
        let correction = MountCorrection::identity(sensor_m).of(&vector);
        proptest::prop_assert!((correction.vector() - vector).norm() < 1e-12);
        // The sensor moves by the shift alone.
        let moved = correction.base_from_stated() * nalgebra::Point3::from(sensor_m);
        proptest::prop_assert!((moved.coords - sensor_m - correction.shift_m).norm() < 1e-12);
    }
}
