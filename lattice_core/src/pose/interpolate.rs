//! Interpolation between two poses.

use nalgebra::{Isometry3, Quaternion, Translation3, Unit, UnitQuaternion};

/// Cosine of the half angle above which slerp and linear interpolation agree to the last bit.
const NEARLY_EQUAL: f64 = 1.0 - 1.0e-14;

/// Pose at `fraction` between `a` (0) and `b` (1): linear translation, slerp on the shorter arc.
pub fn interpolate(a: &Isometry3<f64>, b: &Isometry3<f64>, fraction: f64) -> Isometry3<f64> {
    let translation = a.translation.vector.lerp(&b.translation.vector, fraction);
    Isometry3::from_parts(
        Translation3::from(translation),
        slerp(&a.rotation, &b.rotation, fraction),
    )
}

fn slerp(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>, fraction: f64) -> UnitQuaternion<f64> {
    let dot = a.coords.dot(&b.coords);
    // q and -q are one rotation: use the nearer sign.
    let sign = if dot < 0.0 { -1.0 } else { 1.0 };
    let cosine = dot.abs();
    let (weight_a, weight_b) = if cosine > NEARLY_EQUAL {
        (1.0 - fraction, fraction)
    } else {
        let half_angle = cosine.acos();
        let sine = half_angle.sin();
        (
            ((1.0 - fraction) * half_angle).sin() / sine,
            (fraction * half_angle).sin() / sine,
        )
    };
    let coords = a.coords * weight_a + b.coords * (weight_b * sign);
    Unit::new_normalize(Quaternion::from(coords))
}

/// Tests whether a pose is finite and its rotation normalized.
pub(super) fn is_rigid(pose: &Isometry3<f64>) -> bool {
    pose.translation.vector.iter().all(|v| v.is_finite())
        && (pose.rotation.coords.norm() - 1.0).abs() < 1.0e-3
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use std::f64::consts::PI;

    #[test]
    fn the_sign_of_a_quaternion_does_not_matter() {
        let a = UnitQuaternion::new(Vector3::new(0.1, 0.2, 0.3));
        let b = UnitQuaternion::new(Vector3::new(0.3, -0.2, 0.5));
        let minus_b = Unit::new_unchecked(-b.into_inner());
        let direct = slerp(&a, &b, 0.3);
        let flipped = slerp(&a, &minus_b, 0.3);
        assert!(direct.angle_to(&flipped) < 1.0e-7);
        assert!((direct.coords - flipped.coords).norm() < 1.0e-15);
    }

    #[test]
    fn half_a_turn_is_still_a_rotation() {
        let (a, b) = (
            Isometry3::identity(),
            Isometry3::rotation(Vector3::x() * PI),
        );
        let half = interpolate(&a, &b, 0.5).rotation;
        assert!((half.norm() - 1.0).abs() < 1.0e-15);
        assert!((half.angle() - PI / 2.0).abs() < 1.0e-12);
    }

    #[test]
    fn tiny_turns_are_smooth() {
        for angle in [1.0e-12, 1.0e-9, 1.0e-7, 3.0e-7, 1.0e-6, 1.0e-3] {
            let b = UnitQuaternion::new(Vector3::z() * angle);
            let quarter = slerp(&UnitQuaternion::identity(), &b, 0.25);
            let found = 2.0 * quarter.coords.z.asin();
            assert!(
                (found - 0.25 * angle).abs() < 1.0e-9 * angle,
                "{angle} {found}"
            );
        }
    }
}
