//! Simulated logs of a machine with an Imu.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3};

use crate::pose::{
    AttitudeConvention, InertialCheck, InertialFinding, InertialSample, InertialWindows,
};

const STEP_S: f64 = 0.01;
pub const GRAVITY: f64 = 9.81;

/// Numbers that a seed repeats.
struct Numbers(u64);

impl Numbers {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(1);
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
pub enum Motion {
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
pub struct Log {
    pub seed: u64,
    pub motion: Motion,
    /// Largest tilt of the ground, rad.
    pub slope_rad: f64,
    /// Constant tilt of a ramp, rad.
    pub ramp_rad: f64,
    pub length_s: f64,
    /// Vibration of the accelerometer, m/s².
    pub vibration: f64,
    /// Delay of poses, s.
    pub delay_s: f64,
    /// Tilt of the frame of the poses, and of the Imu on the machine, rad.
    pub tilts_rad: [f64; 2],
}

impl Log {
    pub fn new(seed: u64, motion: Motion) -> Self {
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

    pub fn on_slopes(self, slope_rad: f64) -> Self {
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
    pub fn finding(
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

    pub fn sound(&self) -> Option<InertialFinding> {
        self.finding(|attitude| attitude, |sample| sample)
    }

    pub fn of_convention(&self, convention: AttitudeConvention) -> Option<InertialFinding> {
        // Each is its own inverse.
        self.finding(|attitude| convention.to_enu(&attitude), |sample| sample)
    }

    pub fn of_imu(&self, axes: Matrix3<f64>) -> Option<InertialFinding> {
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
