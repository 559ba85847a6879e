//! Errors of a SPAN-CPT-like INS with RTK: slowly wandering (first-order Gauss-Markov) plus white.

use super::bobcat::{Bobcat, INS_PERIOD_NS, base_from_imu};
use super::random::{Purpose, Stream};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

/// Root mean square of the position error in three dimensions, m (Ryde & Brünig 2011, III.B).
pub const INS_POSITION_RMS_M: f64 = 0.03;

/// Share of each error's variance that is white.
const WHITE_SHARE: f64 = 0.04;
/// Correlation times of position and attitude errors, s.
const POSITION_TIME_S: f64 = 30.0;
const ATTITUDE_TIME_S: f64 = 90.0;
/// Delay of the INS messages, ns.
const MIN_DELAY_NS: f64 = 2e6;
const MEAN_MORE_DELAY_NS: f64 = 1.5e6;
const MAX_DELAY_NS: f64 = 9.5e6;
/// Half the step of the numerical derivatives, s.
const DERIVATIVE_STEP_S: f64 = 5e-4;

/// One INS epoch. Errors are in the pose and velocity of the IMU; the base's pose follows through the mount.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InsSample {
    pub time_ns: i64,
    /// Pose of the IMU as measured.
    pub map_from_imu: Isometry3<f64>,
    /// Pose of `base_link` as it follows from the measured one.
    pub map_from_base: Isometry3<f64>,
    /// Pose of `base_link` without error.
    pub true_map_from_base: Isometry3<f64>,
    /// Velocity of the IMU in the map, measured, m/s.
    pub velocity_mps: Vector3<f64>,
    /// Velocity of `base_link` along its own axes as it follows from the measured one, m/s.
    pub base_velocity_mps: Vector3<f64>,
    /// Turn rate of `base_link` about its own axes, without error, rad/s.
    pub base_turn_rate_radps: Vector3<f64>,
    /// Delay from validity to arrival at the driver, ns: some milliseconds, and less than an epoch.
    pub delay_ns: i64,
}

impl InsSample {
    /// Standard deviations of the IMU's east, north and up, m: two to three between level and height.
    pub const POSITION_SIGMA_M: [f64; 3] = [0.015, 0.015, 0.0212];
    /// Standard deviations of the attitude error about east, north and up, degrees.
    pub const ATTITUDE_SIGMA_DEG: [f64; 3] = [0.02, 0.02, 0.06];
    /// Standard deviation of the velocity, white, m/s per axis.
    pub const VELOCITY_SIGMA_MPS: f64 = 0.02;
}

/// The epochs of a log in order.
#[derive(Debug)]
pub struct InsSamples<'a> {
    bobcat: &'a Bobcat,
    errors: Errors,
    next: i64,
}

impl Bobcat {
    /// The INS epochs from the start of the log to its end.
    pub fn ins(&self) -> InsSamples<'_> {
        InsSamples::new(self)
    }
}

impl<'a> InsSamples<'a> {
    fn new(bobcat: &'a Bobcat) -> Self {
        let next = bobcat.begin_ns() / INS_PERIOD_NS;
        let mut errors = Errors::new(bobcat.seed());
        for _ in 0..next {
            errors.step();
            errors.delay_ns();
        }
        Self {
            bobcat,
            errors,
            next,
        }
    }

    fn sample(&mut self, time_ns: i64) -> InsSample {
        let [position_m, attitude_rad, velocity_error_mps] = self.errors.step();
        let delay_ns = self.errors.delay_ns();
        let time_s = time_ns as f64 * 1e-9;
        let mount = base_from_imu();
        let truth = self.bobcat.map_from_base(time_ns);
        let true_imu = truth * mount;
        let [before, after] = [-DERIVATIVE_STEP_S, DERIVATIVE_STEP_S]
            .map(|step_s| self.bobcat.loader().map_from_base(time_s + step_s));
        let per_s = 0.5 / DERIVATIVE_STEP_S;
        let [from, to] = [before, after].map(|base| (base * mount).translation.vector);
        let imu_velocity = (to - from) * per_s;
        let offset = self.bobcat.ins_offset();
        let map_from_imu = offset
            * Isometry3::from_parts(
                Translation3::from(true_imu.translation.vector + position_m),
                UnitQuaternion::from_scaled_axis(attitude_rad) * true_imu.rotation,
            );
        let velocity_mps = offset.rotation * imu_velocity + velocity_error_mps;
        let turn_rate_radps = (before.rotation.inverse() * after.rotation).scaled_axis() * per_s;
        let lever_mps = turn_rate_radps.cross(&mount.translation.vector);
        InsSample {
            time_ns,
            map_from_imu,
            map_from_base: map_from_imu * mount.inverse(),
            true_map_from_base: truth,
            velocity_mps,
            base_velocity_mps: (offset.rotation * truth.rotation).inverse() * velocity_mps
                - lever_mps,
            base_turn_rate_radps: turn_rate_radps,
            delay_ns,
        }
    }
}

impl Iterator for InsSamples<'_> {
    type Item = InsSample;

    fn next(&mut self) -> Option<InsSample> {
        let time_ns = self.next.checked_mul(INS_PERIOD_NS)?;
        if time_ns > self.bobcat.end_ns() {
            return None;
        }
        self.next += 1;
        Some(self.sample(time_ns))
    }
}

/// State of the error process.
#[derive(Debug)]
struct Errors {
    stream: Stream,
    wander: Option<[Vector3<f64>; 2]>,
}

impl Errors {
    fn new(seed: u64) -> Self {
        Self {
            stream: Stream::new(seed, Purpose::Ins, 0, 0),
            wander: None,
        }
    }

    /// Errors of position (m), attitude (rad) and velocity (m/s) at the next epoch.
    fn step(&mut self) -> [Vector3<f64>; 3] {
        let sigmas = [
            Vector3::from(InsSample::POSITION_SIGMA_M),
            Vector3::from(InsSample::ATTITUDE_SIGMA_DEG.map(f64::to_radians)),
        ];
        let mut normals = || {
            let stream = &mut self.stream;
            [(); 2].map(|()| Vector3::from_fn(|_, _| stream.normal()))
        };
        let (slow, white) = (normals(), normals());
        let wander = match self.wander {
            None => slow,
            Some(before) => {
                let mut now = before;
                for (i, time_s) in [POSITION_TIME_S, ATTITUDE_TIME_S].into_iter().enumerate() {
                    let keep = (-INS_PERIOD_NS as f64 * 1e-9 / time_s).exp();
                    now[i] = before[i] * keep + slow[i] * (1.0 - keep * keep).sqrt();
                }
                now
            }
        };
        self.wander = Some(wander);
        let error = |i: usize| {
            let unit: Vector3<f64> =
                wander[i] * (1.0 - WHITE_SHARE).sqrt() + white[i] * WHITE_SHARE.sqrt();
            unit.component_mul(&sigmas[i])
        };
        let (position, attitude) = (error(0), error(1));
        let velocity =
            Vector3::from_fn(|_, _| InsSample::VELOCITY_SIGMA_MPS * self.stream.normal());
        [position, attitude, velocity]
    }

    /// The least delay plus an exponential one, cut.
    fn delay_ns(&mut self) -> i64 {
        let more_ns = -MEAN_MORE_DELAY_NS * (1.0 - self.stream.uniform()).ln();
        (MIN_DELAY_NS + more_ns).min(MAX_DELAY_NS) as i64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn position_errors_have_the_stated_root_mean_square() {
        let n = 3000;
        let squares: f64 = (0..n)
            .map(|seed| Errors::new(seed).step()[0].norm_squared())
            .sum();
        let rms_m = (squares / n as f64).sqrt();
        assert!((rms_m / INS_POSITION_RMS_M - 1.0).abs() < 0.03, "{rms_m}");
    }

    #[test]
    fn position_errors_keep_their_size_and_wander_slowly() {
        let (mut late, mut steps) = (0.0, 0.0);
        let n = 400;
        for seed in 0..n {
            let mut errors = Errors::new(seed);
            let first = errors.step()[0];
            steps += (errors.step()[0] - first).norm_squared();
            let last = (0..3000).map(|_| errors.step()[0]).last().unwrap();
            late += last.norm_squared();
        }
        let rms = |sum: f64| (sum / n as f64).sqrt();
        let [late, steps] = [rms(late), rms(steps)].map(|rms| rms / INS_POSITION_RMS_M);
        assert!((late - 1.0).abs() < 0.1, "{late} after 30 s");
        assert!((0.2..0.4).contains(&steps), "{steps} between epochs");
    }
}
