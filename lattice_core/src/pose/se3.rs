//! Exponential and logarithm of SE(3), exact near zero and near a half turn.
//!
//! A twist is (rho, phi): translation (m) first, then rotation (rad). exp(rho, phi) has the rotation
//! exp(phi) and the translation V(phi) rho (Barfoot, State Estimation for Robotics, eqs. 7.79 to 7.85).

use nalgebra::{Isometry3, Matrix6, Quaternion, Translation3, UnitQuaternion, Vector3, Vector6};

/// Angle below which the coefficients are evaluated as series, radians.
const SERIES_RAD: f64 = 0.1;

/// Exponential: transform of a twist (rho, phi), m and rad.
pub fn exp(twist: &Vector6<f64>) -> Isometry3<f64> {
    let rho = twist.fixed_rows::<3>(0).into_owned();
    let phi = twist.fixed_rows::<3>(3).into_owned();
    let angle = phi.norm();
    let half = 0.5 * angle;
    // sin(angle / 2) / angle and (1 - cos(angle)) / angle^2
    let sinc = if angle > 0.0 { half.sin() / angle } else { 0.5 };
    let a = 2.0 * sinc * sinc;
    let b = if angle < SERIES_RAD {
        let s = angle * angle;
        1.0 / 6.0 + s * (-1.0 / 120.0 + s * (1.0 / 5040.0 - s / 362_880.0))
    } else {
        (angle - angle.sin()) / (angle * angle * angle)
    };
    let across = phi.cross(&rho);
    let translation = rho + a * across + b * phi.cross(&across);
    let imaginary = sinc * phi;
    let rotation = Quaternion::from_parts(half.cos(), imaginary);
    Isometry3::from_parts(
        Translation3::from(translation),
        UnitQuaternion::new_normalize(rotation),
    )
}

/// Logarithm: twist (rho, phi) of a transform, m and rad; the angle is at most pi.
pub fn log(transform: &Isometry3<f64>) -> Vector6<f64> {
    let (phi, angle) = rotation_vector(&transform.rotation);
    // (1 - angle / 2 cot(angle / 2)) / angle^2
    let c = if angle < SERIES_RAD {
        let s = angle * angle;
        1.0 / 12.0 + s * (1.0 / 720.0 + s * (1.0 / 30_240.0 + s / 1_209_600.0))
    } else {
        let half = 0.5 * angle;
        (1.0 - half * half.cos() / half.sin()) / (angle * angle)
    };
    let t = transform.translation.vector;
    let across = phi.cross(&t);
    let rho = t - 0.5 * across + c * phi.cross(&across);
    Vector6::new(rho.x, rho.y, rho.z, phi.x, phi.y, phi.z)
}

/// Adjoint: takes a twist (rho, phi) of the source frame into the target frame (Barfoot, eq. 7.45).
pub fn adjoint(transform: &Isometry3<f64>) -> Matrix6<f64> {
    let rotation = *transform.rotation.to_rotation_matrix().matrix();
    let mut adjoint = Matrix6::zeros();
    adjoint.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotation);
    adjoint.fixed_view_mut::<3, 3>(3, 3).copy_from(&rotation);
    let lever = transform.translation.vector.cross_matrix() * rotation;
    adjoint.fixed_view_mut::<3, 3>(0, 3).copy_from(&lever);
    adjoint
}

/// Rotation vector (rad) and its angle, 0 to pi.
fn rotation_vector(rotation: &UnitQuaternion<f64>) -> (Vector3<f64>, f64) {
    let q = rotation.quaternion();
    // q and -q are one rotation; the one with w >= 0 has an angle of at most pi.
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    let (w, v) = (sign * q.w, sign * q.imag());
    let sine = v.norm();
    if sine == 0.0 {
        return (Vector3::zeros(), 0.0);
    }
    let angle = 2.0 * sine.atan2(w);
    (v * (angle / sine), angle)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use nalgebra::Matrix4;
    use proptest::prelude::*;

    use super::*;

    fn twist(rho: [f64; 3], axis: [f64; 3], angle: f64) -> Vector6<f64> {
        let phi = Vector3::from(axis).normalize() * angle;
        Vector6::new(rho[0], rho[1], rho[2], phi.x, phi.y, phi.z)
    }

    /// exp as the power series of the 4 x 4 matrix, halved and squared.
    fn exp_by_series(twist: &Vector6<f64>) -> Matrix4<f64> {
        let (r, p) = (twist.fixed_rows::<3>(0), twist.fixed_rows::<3>(3));
        let mut m = Matrix4::zeros();
        m.fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&Vector3::new(p[0], p[1], p[2]).cross_matrix());
        m.fixed_view_mut::<3, 1>(0, 3).copy_from(&r);
        m /= 64.0;
        let (mut sum, mut term) = (Matrix4::identity(), Matrix4::identity());
        for i in 1..20 {
            term = term * m / f64::from(i);
            sum += term;
        }
        for _ in 0..6 {
            sum *= sum;
        }
        sum
    }

    fn axis() -> impl Strategy<Value = [f64; 3]> {
        proptest::array::uniform3(-1.0..1.0)
            .prop_filter("long enough", |a| Vector3::from(*a).norm() > 0.1)
    }

    fn angle() -> impl Strategy<Value = f64> {
        prop_oneof![
            0.0..PI,
            (-12.0..-1.0).prop_map(|e| 10f64.powf(e)),
            (-12.0..-1.0).prop_map(|e| PI - 10f64.powf(e)),
        ]
    }

    proptest! {
        #[test]
        fn log_undoes_exp(
            rho in proptest::array::uniform3(-10.0..10.0),
            axis in axis(),
            angle in angle(),
        ) {
            let xi = twist(rho, axis, angle);
            let back = log(&exp(&xi));
            prop_assert!((back - xi).norm() < 1e-12 * (1.0 + xi.norm()), "{xi} {back}");
        }

        #[test]
        fn exp_is_the_matrix_exponential(
            rho in proptest::array::uniform3(-10.0..10.0),
            axis in axis(),
            angle in angle(),
        ) {
            let xi = twist(rho, axis, angle);
            let difference = exp(&xi).to_homogeneous() - exp_by_series(&xi);
            prop_assert!(difference.norm() < 1e-12, "{difference}");
        }

        #[test]
        fn the_inverse_has_the_opposite_twist(
            rho in proptest::array::uniform3(-10.0..10.0),
            axis in axis(),
            angle in 0.0..3.1,
        ) {
            let xi = twist(rho, axis, angle);
            let product = exp(&xi) * exp(&-xi);
            prop_assert!(log(&product).norm() < 1e-12 * (1.0 + xi.norm()));
        }
    }

    #[test]
    fn small_twists_keep_their_digits() {
        for e in 0..30 {
            let xi = twist([1e-3, -2.0, 0.5], [1.0, 2.0, -3.0], 10f64.powi(-e) * 0.3);
            let phi = xi.fixed_rows::<3>(3).norm();
            let back = log(&exp(&xi));
            let error = (back.fixed_rows::<3>(3) - xi.fixed_rows::<3>(3)).norm();
            assert!(error <= 4e-16 * phi, "{phi} {error}");
        }
    }

    #[test]
    fn a_half_turn_has_an_angle_of_pi() {
        let turn = Isometry3::rotation(Vector3::new(0.0, PI, 0.0));
        assert!((log(&turn).norm() - PI).abs() < 1e-15);
        assert_eq!(log(&Isometry3::identity()), Vector6::zeros());
        assert_eq!(exp(&Vector6::zeros()), Isometry3::identity());
    }
}
