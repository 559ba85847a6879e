//! Error of a pose.

use lattice_core::pose::se3;
use nalgebra::Isometry3;

/// Error of an estimated transform T* against the truth T_GT, in four measures.
///
/// `d_se3` depends on where the origin of the target frame is: a rotation error moves the far origin.
/// `translation_m` and `rotation_rad` do not.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PoseError {
    /// Distance between the translations, metres.
    pub translation_m: f64,
    /// Angle between the rotations, radians.
    pub rotation_rad: f64,
    /// ||log(T* T_GT^-1)||, metres and radians together (Nakamura et al. 2019, eq. 9).
    pub d_se3: f64,
    /// ||log(T_GT^-1 T*)||, the form that does not change with the target frame.
    pub d_se3_left: f64,
}

impl PoseError {
    /// Error of `estimated` against `truth`.
    pub fn between(estimated: &Isometry3<f64>, truth: &Isometry3<f64>) -> PoseError {
        let left = se3::log(&(truth.inverse() * estimated));
        PoseError {
            translation_m: (estimated.translation.vector - truth.translation.vector).norm(),
            rotation_rad: left.fixed_rows::<3>(3).norm(),
            d_se3: se3::log(&(estimated * truth.inverse())).norm(),
            d_se3_left: left.norm(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Translation3, UnitQuaternion, Vector3};

    fn pose(t: [f64; 3], rotation: [f64; 3]) -> Isometry3<f64> {
        Isometry3::new(Vector3::from(t), Vector3::from(rotation))
    }

    #[test]
    fn translation_alone_is_the_same_in_all() {
        let truth = pose([1.0, 2.0, 3.0], [0.0; 3]);
        let error = PoseError::between(&pose([1.0, 2.3, 2.6], [0.0; 3]), &truth);
        for value in [error.translation_m, error.d_se3, error.d_se3_left] {
            assert!((value - 0.5).abs() < 1e-12, "{error:?}");
        }
        assert!(error.rotation_rad < 1e-12);
    }

    #[test]
    fn the_printed_form_grows_with_the_lever_arm_and_the_left_form_does_not() {
        let turn = UnitQuaternion::from_scaled_axis(Vector3::z() * 0.1);
        for lever_m in [0.0, 9.0, 900.0] {
            let truth = pose([lever_m, 0.0, 0.0], [0.0, 0.0, 0.4]);
            let estimated =
                Isometry3::from_parts(Translation3::new(lever_m, 0.0, 0.0), turn * truth.rotation);
            let error = PoseError::between(&estimated, &truth);
            assert_eq!(error.translation_m, 0.0);
            assert!((error.rotation_rad - 0.1).abs() < 1e-12);
            assert!((error.d_se3_left - 0.1).abs() < 1e-12, "{error:?}");
            // T* T_GT^-1 turns about z through the lever's end: rho has the length lever * angle.
            let expected = 0.1 * (1.0 + lever_m * lever_m).sqrt();
            assert!(
                (error.d_se3 - expected).abs() < 1e-10 * expected,
                "{error:?}"
            );
        }
    }
}
