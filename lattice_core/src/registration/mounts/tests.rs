use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::*;

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
            map_from_base: stamped,
            velocity_m_per_s: (after.translation.vector - before.translation.vector) / 0.01,
            rate_rad_per_s: turn.scaled_axis() / 0.01,
        });
        for _ in 0..400 {
            let (azimuth, elevation) = (random.next() * 3.1416, 0.35 * random.next() - 0.1);
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

#[test]
fn explore() {
    for drive in [Drive::Rough, Drive::Flat, Drive::Straight] {
        for (turn, shift, late) in [
            ([0.0; 3], [0.0; 3], 0.0),
            ([2.0, -1.0, 3.0], [0.2, -0.1, 0.1], 0.02),
            ([8.0, -6.0, 10.0], [0.5, -0.6, 0.3], 0.0),
            ([-12.0, 10.0, -13.0], [-0.8, 0.6, 0.8], -0.03),
        ] {
            let wrong = wrong(turn, shift);
            let samples = samples(drive, &wrong, late, 7);
            let begin = std::time::Instant::now();
            match estimate_mount(&samples, &MountOptions::default()) {
                Ok(e) => {
                    println!(
                        "{turn:?} {shift:?} {late}: {:?} -> {:?} planes {} of {} points, {:?}",
                        e.before,
                        e.after,
                        e.planes,
                        e.points,
                        begin.elapsed()
                    );
                    let truth = wrong.vector();
                    for (i, n) in e.numbers.iter().enumerate() {
                        let scale = if i < 3 { 57.29578 } else { 1.0 };
                        let true_value = if i == 6 { -late } else { truth[i] };
                        println!(
                            "   {:5} {:8.4} true {:8.4} sigma {:7.4} {} err/sigma {:.2}",
                            MOUNT_NUMBERS[i],
                            n.value * scale,
                            true_value * scale,
                            n.sigma * scale,
                            n.is_observable,
                            (n.value - true_value) / n.sigma
                        );
                    }
                }
                Err(e) => println!("{turn:?} {shift:?} {e}"),
            }
        }
    }
}
