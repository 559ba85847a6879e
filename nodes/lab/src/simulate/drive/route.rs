//! Routes: straight, or around a rectangle, with the swaying of a machine.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

/// Time in which a machine comes to its speed, s.
const START_S: f64 = 3.0;
/// Amplitudes of heave (m) and of roll and pitch (rad), at frequencies that do not repeat together, rad/s.
const HEAVE_M: f64 = 0.02;
const LEAN_RAD: f64 = 0.01;
const SWAY_PER_S: [f64; 3] = [2.1, 1.7, 1.3];

/// A way at constant speed after a start from rest.
pub(super) struct Route {
    form: Form,
    speed_m_per_s: f64,
    pub length_m: f64,
}

/// Form of a way.
pub(super) enum Form {
    /// Along x from a place.
    Straight { from: [f64; 2] },
    /// Counter-clockwise around a rectangle about 0 with rounded corners; half sizes.
    Around { half_m: [f64; 2], corner_m: f64 },
}

impl Route {
    pub fn new(form: Form, speed_m_per_s: f64, length_m: f64) -> Route {
        Route {
            form,
            speed_m_per_s,
            length_m,
        }
    }

    /// Length of one round.
    pub fn round_m(half_m: [f64; 2], corner_m: f64) -> f64 {
        let straight = 4.0 * (half_m[0] + half_m[1] - 2.0 * corner_m);
        straight + std::f64::consts::TAU * corner_m
    }

    pub fn duration_s(&self) -> f64 {
        self.length_m / self.speed_m_per_s + START_S / 2.0
    }

    pub fn pose(&self, seconds: f64, height_m: f64) -> Isometry3<f64> {
        let along_m = match seconds < START_S {
            true => self.speed_m_per_s * seconds * seconds / (2.0 * START_S),
            false => self.speed_m_per_s * (seconds - START_S / 2.0),
        };
        let (x, y, yaw) = match self.form {
            Form::Straight { from: [x, y] } => (x + along_m, y, 0.0),
            Form::Around { half_m, corner_m } => around(along_m, half_m, corner_m),
        };
        // A machine at rest does not sway.
        let moving = (seconds / START_S).min(1.0);
        let [heave, roll, pitch] = SWAY_PER_S.map(|rate| moving * (rate * seconds).sin());
        let lean = UnitQuaternion::from_euler_angles(LEAN_RAD * roll, LEAN_RAD * pitch, yaw);
        let place = Vector3::new(x, y, height_m + HEAVE_M * heave);
        Isometry3::from_parts(place.into(), lean)
    }
}

/// Place and heading along a rounded rectangle, from the middle of its lower side.
fn around(along_m: f64, half_m: [f64; 2], corner_m: f64) -> (f64, f64, f64) {
    let quarter = std::f64::consts::FRAC_PI_2;
    let arc_m = quarter * corner_m;
    let [a, b] = half_m.map(|half| 2.0 * (half - corner_m));
    let mut rest = (along_m + a / 2.0).rem_euclid(Route::round_m(half_m, corner_m));
    let mut yaw = 0.0;
    let (mut x, mut y) = (-a / 2.0, -half_m[1]);
    for side in [a, b, a, b] {
        let (c, s) = (f64::cos(yaw), f64::sin(yaw));
        if rest <= side {
            return (x + c * rest, y + s * rest, yaw);
        }
        (x, y, rest) = (x + c * side, y + s * side, rest - side);
        let turned = (rest / corner_m).min(quarter);
        // The centre of the corner lies to the left.
        let center = (x - s * corner_m, y + c * corner_m);
        let end = yaw + turned;
        (x, y) = (
            center.0 + corner_m * end.sin(),
            center.1 - corner_m * end.cos(),
        );
        if rest <= arc_m {
            return (x, y, end);
        }
        (rest, yaw) = (rest - arc_m, yaw + quarter);
    }
    (x, y, yaw)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_round_is_smooth_and_closes() {
        let (half_m, corner_m) = ([20.0, 10.0], 4.0);
        let round_m = Route::round_m(half_m, corner_m);
        let mut before = around(0.0, half_m, corner_m);
        for i in 1..=1000 {
            let now = around(round_m * f64::from(i) / 1000.0, half_m, corner_m);
            let step_m = f64::hypot(now.0 - before.0, now.1 - before.1);
            assert!((step_m - round_m / 1000.0).abs() < 1e-3, "{i}: {step_m}");
            before = now;
        }
        assert!(before.0.abs() < 1e-9 && (before.1 + 10.0).abs() < 1e-9);
    }
}
