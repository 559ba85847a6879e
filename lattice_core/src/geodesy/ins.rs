//! Pose of the machine from the position and attitude of an INS.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use std::f64::consts::TAU;

/// Yaw in radians, -pi..=pi, counter-clockwise from east, of an azimuth in degrees, clockwise from north: 90 degrees
/// is yaw 0.
pub fn yaw_rad_from_azimuth_deg(azimuth_deg: f64) -> f64 {
    let yaw_rad = (90.0 - azimuth_deg % 360.0).to_radians();
    yaw_rad - TAU * (yaw_rad / TAU).round()
}

/// Rotation from body axes (x forward, y left, z up) to local east-north-up axes of a NovAtel attitude in degrees.
///
/// NovAtel rotates a frame of x right, y forward, z up about z by the azimuth (left-handed, from north), then about x
/// by the pitch, then about y by the roll. In body axes this is `Rz(yaw) Ry(-pitch) Rx(roll)`. Positive pitch raises
/// the nose, positive roll lowers the right side.
pub fn enu_from_flu(roll_deg: f64, pitch_deg: f64, azimuth_deg: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_euler_angles(
        roll_deg.to_radians(),
        -pitch_deg.to_radians(),
        yaw_rad_from_azimuth_deg(azimuth_deg),
    )
}

/// Mount of an INS on the machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InsMount {
    /// Lever arm: reference point of the INS position in base_link (FLU), metres.
    pub lever_arm_m: Vector3<f64>,
    /// Boresight: rotation from the axes of the INS to those of base_link.
    pub base_from_ins: UnitQuaternion<f64>,
}

impl InsMount {
    /// Creates a mount from a lever arm in metres and fixed-axis roll, pitch, yaw in radians of the INS in base_link.
    pub fn new(lever_arm_m: Vector3<f64>, boresight_rpy_rad: [f64; 3]) -> InsMount {
        let [roll, pitch, yaw] = boresight_rpy_rad;
        InsMount {
            lever_arm_m,
            base_from_ins: UnitQuaternion::from_euler_angles(roll, pitch, yaw),
        }
    }

    /// Pose of base_link in the map, from the position of the INS reference point (metres) and the attitude of the
    /// INS, both in the map frame.
    pub fn map_from_base(
        &self,
        ins_position_m: &Vector3<f64>,
        map_from_ins: &UnitQuaternion<f64>,
    ) -> Isometry3<f64> {
        let rotation = map_from_ins * self.base_from_ins.inverse();
        let position_m = ins_position_m - rotation * self.lever_arm_m;
        Isometry3::from_parts(Translation3::from(position_m), rotation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    const TINY: f64 = 1.0e-12;

    /// The same attitude, composed in the vendor's own axes and turned into ours.
    #[test]
    fn equals_the_composition_in_the_frame_of_the_vendor() {
        let turn = |axis: Vector3<f64>, deg: f64| UnitQuaternion::new(axis * deg.to_radians());
        let rfu_from_flu = turn(Vector3::z(), 90.0);
        for (roll, pitch, azimuth) in [(3.0, -7.0, 200.0), (-25.0, 40.0, 15.0)] {
            let enu_from_rfu =
                turn(Vector3::z(), -azimuth) * turn(Vector3::x(), pitch) * turn(Vector3::y(), roll);
            let expected = enu_from_rfu * rfu_from_flu;
            let matrix = |q: UnitQuaternion<f64>| q.to_rotation_matrix().into_inner();
            let error = matrix(enu_from_flu(roll, pitch, azimuth)) - matrix(expected);
            assert!(error.norm() < TINY, "{error}");
        }
    }

    #[test]
    fn the_boresight_is_taken_out() {
        let base_in_map = Isometry3::new(Vector3::new(5.0, -3.0, 1.0), Vector3::new(0.1, 0.2, 2.0));
        let mount = InsMount::new(Vector3::new(0.3, -0.2, 1.1), [0.02, -0.03, FRAC_PI_2]);
        let ins_position = base_in_map * nalgebra::Point3::from(mount.lever_arm_m);
        let map_from_ins = base_in_map.rotation * mount.base_from_ins;
        let found = mount.map_from_base(&ins_position.coords, &map_from_ins);
        let apart = found.translation.vector - base_in_map.translation.vector;
        assert!(apart.norm() < TINY, "{apart}");
        assert!((found.rotation.coords - base_in_map.rotation.coords).norm() < TINY);
    }
}
