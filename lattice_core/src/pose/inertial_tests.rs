//! Thirty logs with one fault each and a hundred sound ones, of a simulated machine on slopes.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::*;

const STEP_S: f64 = 0.01;
const GRAVITY: f64 = 9.81;

/// Numbers that a seed repeats.
struct Numbers(u64);

impl Numbers {
    fn uniform(&mut self) -> f64 {
        let step = |x: u64| x.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(1);
        self.0 = step(self.0);
        let high = (self.0 ^ (self.0 >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        (high >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.uniform()).ln()).sqrt() * (TAU * self.uniform()).cos()
    }

    fn vector(&mut self, sigma: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| sigma * self.normal())
    }
}

/// Motion of a machine.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Motion {
    /// Drives with bends, also back.
    Drives,
    /// Accelerates and brakes at 3 m/s².
    Hurries,
    Stands,
    /// Turns on the spot.
    Spins,
    /// Moves at an angle to its x axis that wanders.
    Skids,
}

/// A log: motion, ground and sensor.
#[derive(Clone, Copy, Debug)]
struct Log {
    seed: u64,
    motion: Motion,
    /// Largest tilt of the ground, rad.
    slope_rad: f64,
    /// Constant tilt of a ramp, rad.
    ramp_rad: f64,
    length_s: f64,
    /// Vibration of the accelerometer, m/s².
    vibration: f64,
    /// Delay of poses, s.
    delay_s: f64,
    /// Tilt of the frame of the poses, and of the Imu on the machine, rad.
    tilts_rad: [f64; 2],
}

impl Log {
    fn new(seed: u64, motion: Motion) -> Self {
        Self {
            seed,
            motion,
            slope_rad: 0.08,
            ramp_rad: 0.0,
            length_s: 180.0,
            vibration: 0.3,
            delay_s: 0.0,
            tilts_rad: [0.0; 2],
        }
    }

    fn on_slopes(self, slope_rad: f64) -> Self {
        Self { slope_rad, ..self }
    }

    /// True poses, every 10 ms.
    fn poses(&self) -> Vec<Isometry3<f64>> {
        let mut numbers = Numbers(self.seed);
        let phases: [f64; 8] = [(); 8].map(|()| TAU * numbers.uniform());
        let period_s = 6.0 + 6.0 * numbers.uniform();
        let mut yaw = phases[0];
        let mut at = Vector3::zeros();
        let steps = (self.length_s / STEP_S) as usize;
        let poses = (0..steps).map(|step| {
            let time_s = step as f64 * STEP_S;
            let wave = |period_s: f64, phase: f64| (TAU * time_s / period_s + phase).sin();
            let (speed, turn) = match self.motion {
                Motion::Stands => (0.0, 0.0),
                Motion::Spins => (0.0, 0.6 + 0.3 * wave(period_s, phases[1])),
                Motion::Hurries => (
                    4.0 + 4.0 * wave(8.0, phases[1]),
                    0.2 * wave(29.0, phases[2]),
                ),
                Motion::Drives | Motion::Skids => {
                    let back = if wave(4.7 * period_s, phases[3]) < -0.6 {
                        -0.5
                    } else {
                        1.0
                    };
                    let turn = 0.3 * wave(period_s, phases[1]) + 0.2 * wave(31.0, phases[2]);
                    (2.0 * back, turn)
                }
            };
            yaw += turn * STEP_S;
            let slip = match self.motion {
                Motion::Skids => 0.6 * wave(13.0, phases[4]),
                _ => 0.0,
            };
            at += Vector3::new((yaw + slip).cos(), (yaw + slip).sin(), 0.0) * speed * STEP_S;
            // The ground has slopes that depend on the place.
            let is_still = matches!(self.motion, Motion::Stands | Motion::Spins);
            let hill = |over_m: f64, phase: f64| match is_still {
                true => 0.5,
                false => ((at.x + 0.6 * at.y) / over_m + phase).sin(),
            };
            let (east, north) = (hill(5.0, phases[5]), hill(3.7, phases[6]));
            let normal = Vector3::new(
                self.slope_rad * east + self.ramp_rad,
                self.slope_rad * north,
                1.0,
            );
            let up = normal.normalize();
            let ahead = Vector3::new(yaw.cos(), yaw.sin(), 0.0);
            let left = up.cross(&ahead).normalize();
            let axes = Matrix3::from_columns(&[left.cross(&up), left, up]);
            let height = Vector3::new(0.0, 0.0, 1.5 * self.slope_rad * (east + north));
            Isometry3::from_parts(
                (at + height).into(),
                Rotation3::from_matrix_unchecked(axes).into(),
            )
        });
        poses.collect()
    }

    /// Finding of the log, with attitudes and samples of a sensor as faults change them.
    fn finding(
        &self,
        attitude: impl Fn(UnitQuaternion<f64>) -> UnitQuaternion<f64>,
        sample: impl Fn(InertialSample) -> InertialSample,
    ) -> Option<InertialFinding> {
        let mut numbers = Numbers(self.seed ^ 0x00ff_00ff);
        let truth = self.poses();
        let [frame, mount] = self
            .tilts_rad
            .map(|tilt| UnitQuaternion::from_euler_angles(0.6 * tilt, tilt, 0.0));
        let stated: Vec<_> = truth
            .iter()
            .map(|pose| {
                let error = UnitQuaternion::from_scaled_axis(numbers.vector(0.002));
                let place = pose.translation.vector + numbers.vector(0.01);
                let given = attitude(frame * pose.rotation * error);
                Isometry3::from_parts(place.into(), given)
            })
            .collect();
        let bias = [numbers.vector(0.1), numbers.vector(0.005)];
        let (mut windows, mut check) = (InertialWindows::default(), InertialCheck::default());
        for (step, around) in truth.windows(3).enumerate() {
            let [before, at, after] = [around[0], around[1], around[2]];
            let bend =
                before.translation.vector + after.translation.vector - 2.0 * at.translation.vector;
            let force = bend / (STEP_S * STEP_S) + GRAVITY * Vector3::z();
            let rate = (before.rotation.inverse() * after.rotation).scaled_axis() / (2.0 * STEP_S);
            let one = sample(InertialSample {
                stamp_ns: (step as i64 + 1) * 10_000_000,
                force: Some(
                    mount * (at.rotation.inverse() * force)
                        + bias[0]
                        + numbers.vector(self.vibration),
                ),
                rate: Some(mount * rate + bias[1] + numbers.vector(0.01)),
            });
            let Some(window) = windows.on_sample(&one) else {
                continue;
            };
            let late = (self.delay_s / STEP_S) as i64;
            let pose = |at_ns: i64| stated.get((at_ns / 10_000_000 - late).max(0) as usize);
            let middle_ns = (window.from_ns + window.to_ns) / 2;
            let around = [window.from_ns, middle_ns, window.to_ns].map(pose);
            if let [Some(from), Some(middle), Some(to)] = around {
                check.on_window(&window, &[*from, *middle, *to]);
            }
        }
        check.finding()
    }

    fn sound(&self) -> Option<InertialFinding> {
        self.finding(|attitude| attitude, |sample| sample)
    }

    fn of_convention(&self, convention: AttitudeConvention) -> Option<InertialFinding> {
        // Each is its own inverse.
        self.finding(|attitude| convention.to_enu(&attitude), |sample| sample)
    }

    fn of_imu(&self, axes: Matrix3<f64>) -> Option<InertialFinding> {
        self.finding(
            |attitude| attitude,
            |sample| InertialSample {
                force: sample.force.map(|force| axes * force),
                rate: sample.rate.map(|rate| axes * rate),
                ..sample
            },
        )
    }
}

/// Logs without a fault, by kind and seed.
fn sound_logs() -> Vec<(&'static str, Log)> {
    use Motion::{Drives, Hurries, Skids, Spins, Stands};
    let of = |kind, log: fn(u64) -> Log| (0..10).map(move |seed| (kind, log(seed)));
    let mut all: Vec<_> = of("driving", |seed| Log::new(seed, Drives)).collect();
    all.extend(of("level", |seed| Log::new(seed, Drives).on_slopes(0.005)));
    all.extend(of("standing", |seed| Log::new(seed, Stands)));
    all.extend(of("spinning", |seed| Log::new(seed, Spins)));
    all.extend(of("skidding", |seed| Log::new(seed, Skids).on_slopes(0.02)));
    all.extend(of("hurrying", |seed| {
        Log::new(seed, Hurries).on_slopes(0.01)
    }));
    all.extend(of("ramp of 20 degrees", |seed| Log {
        ramp_rad: 0.364,
        ..Log::new(seed, Drives)
    }));
    all.extend(of("vibrating", |seed| Log {
        vibration: 8.0,
        ..Log::new(seed, Drives)
    }));
    all.extend(of("late poses", |seed| Log {
        delay_s: 0.3 * seed as f64,
        ..Log::new(seed, Drives)
    }));
    all.extend(of("tilted frame and mount", |seed| Log {
        tilts_rad: [0.2, -0.15],
        ..Log::new(seed, Drives).on_slopes(0.03)
    }));
    all
}

#[test]
fn a_hundred_sound_logs_raise_no_alarm() {
    let logs = sound_logs();
    assert_eq!(logs.len(), 100);
    let alarms = logs
        .iter()
        .filter_map(|(kind, log)| Some((kind, log.seed, log.sound()?)));
    let alarms: Vec<_> = alarms.collect();
    assert!(alarms.is_empty(), "{alarms:?}");
}

#[test]
fn thirty_logs_with_one_fault_each_are_named() {
    use AttitudeConvention::{Compass, Enu, Ned, PitchUp, RollLeft, Swapped};
    let mut wrong = Vec::new();
    let mut hold = |what: String, found: Option<InertialFinding>, is_right: bool| {
        if !is_right {
            wrong.push((what, found));
        }
    };
    let mut count = 0;
    for seed in 100..103 {
        let drives = Log::new(seed, Motion::Drives);
        for convention in [Ned, PitchUp, RollLeft, Swapped, Compass] {
            let found = drives.of_convention(convention);
            let is_certain = convention != Compass;
            let named = InertialFinding::Attitude {
                convention: Some(convention),
                is_certain,
            };
            hold(format!("{convention:?}"), found, found == Some(named));
            count += 1;
        }
        let about = |roll, pitch, yaw| {
            UnitQuaternion::from_euler_angles(roll, pitch, yaw)
                .to_rotation_matrix()
                .into_inner()
        };
        let (upside_down, aside) = (about(PI, 0.0, 0.0), about(0.0, 0.0, FRAC_PI_2));
        for turn in [upside_down, aside] {
            let found = drives.of_imu(turn.map(f64::round));
            let is_right = matches!(found, Some(InertialFinding::Turned { turn: mend, is_certain: true })
                if (mend.to_rotation_matrix().into_inner() * turn - Matrix3::identity()).norm() < 1e-6);
            hold(format!("{turn}"), found, is_right);
            count += 1;
        }
        let found = drives.of_imu(Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0)));
        hold(
            "left-handed".into(),
            found,
            found == Some(InertialFinding::LeftHanded),
        );
        let found = drives.finding(
            |attitude| attitude,
            |sample| InertialSample {
                force: sample.force.map(|force| force / GRAVITY),
                ..sample
            },
        );
        hold("g".into(), found, found == Some(InertialFinding::ForceInG));
        let found = drives.finding(
            |attitude| attitude,
            |sample| InertialSample {
                rate: sample.rate.map(|rate| rate.map(f64::to_degrees)),
                ..sample
            },
        );
        hold(
            "degrees".into(),
            found,
            found == Some(InertialFinding::RateInDegrees),
        );
        count += 3;
    }
    assert_eq!(count, 30);
    assert!(wrong.is_empty(), "{wrong:?}");
    assert_eq!(Log::new(1, Motion::Drives).of_convention(Enu), None);
}

/// Faults with less to see: no finding is wrong, an attitude is called certain by two witnesses alone.
#[test]
fn what_a_log_does_not_show_is_not_certain() {
    let level = Log::new(7, Motion::Drives).on_slopes(0.003);
    for convention in [AttitudeConvention::PitchUp, AttitudeConvention::RollLeft] {
        assert_eq!(level.of_convention(convention), None);
    }
    // The gyroscope is the only witness of a heading.
    for motion in [Motion::Spins, Motion::Drives] {
        let found = Log::new(7, motion)
            .on_slopes(0.003)
            .of_convention(AttitudeConvention::Compass);
        let expected = InertialFinding::Attitude {
            convention: Some(AttitudeConvention::Compass),
            is_certain: false,
        };
        assert_eq!(found, Some(expected), "{motion:?}");
    }
    // Without gyroscope the pitch may be that of a turned Imu.
    let found = Log::new(7, Motion::Drives).finding(
        |attitude| AttitudeConvention::PitchUp.to_enu(&attitude),
        |sample| InertialSample {
            rate: None,
            ..sample
        },
    );
    let expected = InertialFinding::Attitude {
        convention: Some(AttitudeConvention::PitchUp),
        is_certain: false,
    };
    assert_eq!(found, Some(expected));
    let roof = UnitQuaternion::from_euler_angles(PI, 0.0, 0.0);
    let stands = Log::new(7, Motion::Stands);
    let found = stands.of_imu(Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0)));
    let Some(InertialFinding::Turned { turn, is_certain }) = found else {
        panic!("{found:?}");
    };
    assert!(!is_certain && turn.angle_to(&roof) < 1e-6, "{turn}");
    let found = Log::new(7, Motion::Drives).finding(
        |attitude| attitude,
        |sample| InertialSample {
            force: sample.force.map(|force| -force),
            ..sample
        },
    );
    assert_eq!(found, Some(InertialFinding::OppositeForce));
    let found = Log::new(7, Motion::Drives).finding(
        |attitude| attitude * roof,
        |sample| InertialSample {
            force: sample.force.map(|force| roof.inverse() * force),
            rate: sample.rate.map(|rate| roof.inverse() * rate),
            ..sample
        },
    );
    assert_eq!(found, Some(InertialFinding::UpsideDown));
}

#[test]
fn a_sensor_without_measurements_is_not_judged() {
    let none = |sample: InertialSample| InertialSample {
        force: None,
        rate: None,
        ..sample
    };
    let zero = |sample: InertialSample| InertialSample {
        force: Some(Vector3::zeros()),
        rate: Some(Vector3::zeros()),
        ..sample
    };
    for motion in [Motion::Drives, Motion::Spins, Motion::Stands] {
        for convention in [AttitudeConvention::Enu, AttitudeConvention::Ned] {
            let log = Log::new(3, motion);
            assert_eq!(log.finding(|given| convention.to_enu(&given), none), None);
            assert_eq!(log.finding(|given| convention.to_enu(&given), zero), None);
        }
    }
}
