//! Prediction of motion, its uncertainty, and the gate that follows from it.

use nalgebra::{Isometry3, Matrix3, Matrix6, Vector6};

use super::sweep::{AngularRate, turn};
use crate::pose::se3;

/// Initial standard deviation of predictions, metres.
const FIRST_DEVIATION_M: f64 = 2.0;
/// Deviation below which the gate does not narrow, metres.
const LEAST_DEVIATION_M: f64 = 0.1;
/// Lower bound of the deviation of a prediction along weak directions, by the noise of a pose, metres.
const POSE_NOISE_M: f64 = 0.01;
/// Weight of the newest deviation in the mean, which thus covers some 20.
const NEWEST: f64 = 0.05;
/// Error of the motion by wheels, as a fraction of its length.
const WHEEL_ERROR: f64 = 0.05;

/// Measured motion since the scan before.
#[derive(Clone, Copy, Debug, Default)]
pub struct Prior<'a> {
    /// Motion of the base from the end of the previous scan to the end of this one, as by wheels: `before_from_now`.
    pub motion: Option<Isometry3<f64>>,
    /// Gyroscope samples from the end of the previous scan to the end of this one, in order of time.
    pub rates: &'a [AngularRate],
}

/// Constant-velocity prediction with its deviations.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    /// Velocity in the base frame, m/s and rad/s; `None` before two scans were registered.
    velocity: Option<Vector6<f64>>,
    /// Sum and number of squared deviations that determine the gate.
    squares: f64,
    count: f64,
    /// Mean of all squared deviations.
    mean_square: f64,
    /// Standard deviations along weak directions: of the motion from scan to scan, and of the position, metres.
    weak_step_m: f64,
    weak_m: f64,
}

impl Motion {
    /// Unknown velocity.
    pub fn unknown() -> Motion {
        Motion {
            velocity: None,
            squares: FIRST_DEVIATION_M * FIRST_DEVIATION_M,
            count: 1.0,
            mean_square: LEAST_DEVIATION_M * LEAST_DEVIATION_M,
            weak_step_m: 0.0,
            weak_m: 0.0,
        }
    }

    /// Velocity in the base frame, m/s and rad/s.
    pub fn velocity(&self) -> Vector6<f64> {
        self.velocity.unwrap_or_else(Vector6::zeros)
    }

    /// True before two scans were registered.
    pub fn is_unknown(&self) -> bool {
        self.velocity.is_none()
    }

    /// Motion from the end of a scan to that of the next one.
    pub fn predict(&self, from_ns: i64, to_ns: i64, prior: &Prior) -> Isometry3<f64> {
        let steady = || se3::exp(&(self.velocity() * seconds(from_ns, to_ns)));
        let mut motion = prior.motion.unwrap_or_else(steady);
        if !prior.rates.is_empty() {
            motion.rotation = turn(prior.rates, from_ns, to_ns);
        }
        motion
    }

    /// Gate: maximum distance of correspondences, three standard deviations of predictions, metres.
    pub fn gate_m(&self) -> f64 {
        3.0 * (self.squares / self.count).sqrt()
    }

    /// Updates the velocity by the motion that registration found.
    pub fn update(
        &mut self,
        found: &Isometry3<f64>,
        predicted: &Isometry3<f64>,
        seconds: f64,
        arm_m: f64,
    ) {
        let apart = predicted.inverse() * found;
        let turned_m = 2.0 * arm_m * (apart.rotation.angle() / 2.0).sin();
        let deviation_m = apart.translation.vector.norm() + turned_m;
        if deviation_m > LEAST_DEVIATION_M {
            self.squares += deviation_m * deviation_m;
            self.count += 1.0;
        }
        if self.velocity.is_some() {
            self.mean_square += NEWEST * (deviation_m * deviation_m - self.mean_square);
        }
        if seconds > 0.0 {
            self.velocity = Some(se3::log(found) / seconds);
        }
    }

    /// Adds the uncertainty of a predicted motion along weak directions. Returns three standard deviations of the
    /// position, metres; `INFINITY` if the velocity is unknown.
    pub fn add_weak(&mut self, motion: &Isometry3<f64>, prior: &Prior) -> f64 {
        let step_m = match (prior.motion, self.velocity) {
            (Some(_), _) => WHEEL_ERROR * motion.translation.vector.norm(),
            (None, None) => f64::INFINITY,
            (None, Some(_)) => {
                self.weak_step_m += self.mean_square.sqrt().max(POSE_NOISE_M);
                self.weak_step_m
            }
        };
        self.weak_m += step_m;
        3.0 * self.weak_m
    }

    /// Ends a sequence of weak scans: the map constrains the pose again.
    pub fn end_weak(&mut self) {
        (self.weak_step_m, self.weak_m) = (0.0, 0.0);
    }

    /// Standard deviation of the position along weak directions, metres.
    pub fn weak_m(&self) -> f64 {
        self.weak_m
    }
}

pub(super) fn seconds(from_ns: i64, to_ns: i64) -> f64 {
    to_ns.saturating_sub(from_ns) as f64 * 1e-9
}

/// Propagates the covariance of a pose along a displacement (axes of the map, metres): errors of rotation change the
/// position.
pub(super) fn carried(
    covariance: &Matrix6<f64>,
    displacement_m: &nalgebra::Vector3<f64>,
) -> Matrix6<f64> {
    let mut carry = Matrix6::identity();
    let lever: Matrix3<f64> = -displacement_m.cross_matrix();
    carry.fixed_view_mut::<3, 3>(0, 3).copy_from(&lever);
    carry * covariance * carry.transpose()
}
