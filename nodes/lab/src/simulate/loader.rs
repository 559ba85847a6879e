//! Pose of the loader on the ground.

use super::ground::ground_height_m;
use super::mission::Mission;
use super::random::{Purpose, Stream};
use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector2, Vector3};

/// Half of wheel base and track, m.
const HALF_WHEELS_M: [f64; 2] = [0.55, 0.75];
/// Vibration at full effort: frequency (Hz), heave (m), roll (rad), pitch (rad).
const MODES: [(f64, f64, f64, f64); 3] = [
    (4.7, 0.004, 0.0030, 0.0040),
    (9.1, 0.0015, 0.0010, 0.0014),
    (14.3, 0.0005, 0.0004, 0.0004),
];
/// Share of the vibration that the idling engine makes.
const IDLE: f64 = 0.15;

/// The skid-steer loader: where it is at any time. The seed sets nothing but the phases of the vibration.
#[derive(Clone, Debug)]
pub struct Loader {
    mission: Mission,
    phases_rad: [[f64; 3]; 3],
}

impl Loader {
    /// A loader on its tour of the earth-moving site.
    pub fn new(seed: u64) -> Self {
        let mut stream = Stream::new(seed, Purpose::Vibration, 0, 0);
        let phases_rad =
            [(); 3].map(|()| [(); 3].map(|()| std::f64::consts::TAU * stream.uniform()));
        Self {
            mission: Mission::earth_moving(),
            phases_rad,
        }
    }

    /// `map_from_base`: wheels on the smooth ground, plus vibration.
    pub fn map_from_base(&self, time_s: f64) -> Isometry3<f64> {
        let planar = self.mission.at(time_s);
        let [heave_m, roll_rad, pitch_rad] = self.vibration(time_s, planar.effort);
        let (mut pose, level) = stand(planar.position_m, planar.yaw_rad);
        pose.translation.vector += level * Vector3::new(0.0, 0.0, heave_m);
        pose.rotation *= UnitQuaternion::from_euler_angles(roll_rad, pitch_rad, 0.0);
        pose
    }

    /// Heave (m), roll and pitch (rad).
    fn vibration(&self, time_s: f64, effort: f64) -> [f64; 3] {
        let strength = IDLE + (1.0 - IDLE) * effort;
        let mut sums = [0.0; 3];
        for ((hertz, heave_m, roll_rad, pitch_rad), phases) in
            MODES.into_iter().zip(&self.phases_rad)
        {
            let amplitudes = [heave_m, roll_rad, pitch_rad];
            for ((sum, amplitude), phase) in sums.iter_mut().zip(amplitudes).zip(phases) {
                let angle = std::f64::consts::TAU * hertz * time_s + phase;
                *sum += strength * amplitude * angle.sin();
            }
        }
        sums
    }
}

/// Pose with the wheels on the ground, and its rotation.
fn stand(position_m: Vector2<f64>, yaw_rad: f64) -> (Isometry3<f64>, Rotation3<f64>) {
    let (sin, cos) = yaw_rad.sin_cos();
    let (forward, left) = (Vector2::new(cos, sin), Vector2::new(-sin, cos));
    let [half_length, half_width] = HALF_WHEELS_M;
    let height = |x: f64, y: f64| {
        let wheel = position_m + forward * (x * half_length) + left * (y * half_width);
        ground_height_m(wheel.x, wheel.y)
    };
    let [front_left, front_right, rear_left, rear_right] = [
        height(1.0, 1.0),
        height(1.0, -1.0),
        height(-1.0, 1.0),
        height(-1.0, -1.0),
    ];
    let rise = 0.25 * (front_left + front_right - rear_left - rear_right) / half_length;
    let bank = 0.25 * (front_left + rear_left - front_right - rear_right) / half_width;
    let x_axis = forward.push(rise).normalize();
    let z_axis = x_axis.cross(&left.push(bank)).normalize();
    let y_axis = z_axis.cross(&x_axis);
    let rotation =
        Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x_axis, y_axis, z_axis]));
    let z = 0.25 * (front_left + front_right + rear_left + rear_right);
    let translation = Translation3::from(position_m.push(z));
    (
        Isometry3::from_parts(translation, UnitQuaternion::from_rotation_matrix(&rotation)),
        rotation,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::site::Site;

    #[test]
    fn keeps_clear_of_obstacles_and_of_steep_ground() {
        let (site, loader) = (Site::earth_moving(), Loader::new(3));
        let (mut steepest, mut sloped) = (0.0f64, 0);
        for i in 0..(loader.mission.duration_s() * 10.0) as i32 {
            let time_s = f64::from(i) * 0.1;
            let pose = loader.map_from_base(time_s);
            let position = pose.translation.vector;
            for obstacle in site.obstacles() {
                let clearance_m = obstacle.ground_clearance_m(&position.xy());
                assert!(clearance_m > 1.8, "{clearance_m} m at {time_s} s");
            }
            let tilt_deg = (pose.rotation * Vector3::z()).z.acos().to_degrees();
            steepest = steepest.max(tilt_deg);
            sloped += i32::from(tilt_deg > 3.0);
            let ground = site.ground().height_m(position.x, position.y).unwrap();
            let off_m = position.z - ground;
            assert!(off_m.abs() < 0.25, "{off_m} m off the ground at {time_s} s");
        }
        assert!((8.0..22.0).contains(&steepest), "steepest {steepest} deg");
        assert!(sloped > 300, "{sloped} tenths of a second on a slope");
    }

    #[test]
    fn velocity_and_turn_rate_are_continuous() {
        let loader = Loader::new(1);
        let h = 2e-4;
        for start_s in [0.0, 8.0, 17.0, 29.0, loader.mission.duration_s() - 1.0] {
            let (mut linear, mut angular) = (Vec::new(), Vec::new());
            for i in 0..10_000 {
                let [a, b] = [i, i + 1].map(|i| loader.map_from_base(start_s + f64::from(i) * h));
                linear.push((b.translation.vector - a.translation.vector) / h);
                angular.push((a.rotation.inverse() * b.rotation).scaled_axis() / h);
            }
            for pair in linear.windows(2).chain(angular.windows(2)) {
                let jump = (pair[1] - pair[0]).norm();
                assert!(jump < 30.0 * h, "jump of {jump} after {start_s} s");
            }
        }
    }
}
