//! Calibration results as messages.

use lattice_core::registration::{Calibration, DirectionKind, Verdict};
use lattice_msgs::geometry_msgs::Vector3;
use lattice_msgs::lattice::{CalibrationResult, ClassReliability, WeakDirection};
use nalgebra::{Isometry3, Matrix6};

use super::geometry::transform_stamped;

/// Message code of a verdict.
pub fn verdict_code(verdict: Verdict) -> u8 {
    match verdict {
        Verdict::Ok => CalibrationResult::OK,
        Verdict::Ambiguous => CalibrationResult::AMBIGUOUS,
        Verdict::Degenerate => CalibrationResult::DEGENERATE,
        Verdict::NoOverlap => CalibrationResult::NO_OVERLAP,
        Verdict::RejectedInput => CalibrationResult::REJECTED_INPUT,
    }
}

/// Name of a verdict code; NONE if unknown.
pub fn verdict_name(code: u8) -> &'static str {
    let mut all = Verdict::ALL.into_iter();
    let found = all.find(|verdict| verdict_code(*verdict) == code);
    found.map_or("NONE", Verdict::name)
}

/// Result message of a calibration; header, frames and counts are set by the caller.
pub fn result_from(found: &Calibration) -> CalibrationResult {
    let weak = found.weak_directions.iter();
    let reliability = found.class_reliability.iter();
    let mut result = CalibrationResult {
        verdict: match found.cancelled {
            true => CalibrationResult::NONE,
            false => verdict_code(found.verdict),
        },
        reason: found.reason.clone(),
        log_margin: found.margin.log_ratio,
        inlier_fraction: found.inlier_fraction,
        rmse_m: found.rmse_m,
        weak_directions: weak
            .map(|weak| WeakDirection {
                axis: Vector3 {
                    x: weak.axis.x,
                    y: weak.axis.y,
                    z: weak.axis.z,
                },
                kind: match weak.kind {
                    DirectionKind::Translation => WeakDirection::TRANSLATION,
                    DirectionKind::Rotation => WeakDirection::ROTATION,
                },
                sigma: weak.sigma,
            })
            .collect(),
        class_reliability: reliability
            .map(|class| ClassReliability {
                class_id: class.source_class,
                agreement: class.agreement,
                weight: class.weight,
            })
            .collect(),
        method: found.method.to_owned(),
        ..CalibrationResult::default()
    };
    set_pose(&mut result, &found.target_from_source, &found.covariance);
    result
}

/// Sets pose and covariance of a result.
pub fn set_pose(
    result: &mut CalibrationResult,
    map_from_headset: &Isometry3<f64>,
    covariance: &Matrix6<f64>,
) {
    result.transform = transform_stamped("", "", 0, map_from_headset).transform;
    // The matrix is symmetric, so row and column order agree.
    result.covariance.copy_from_slice(covariance.as_slice());
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convert::geometry::isometry_from_transform;
    use nalgebra::Vector3 as V;

    #[test]
    fn everything_that_was_found_is_told() {
        let mut found = Calibration::refused(Verdict::Degenerate, "slides");
        found.target_from_source = Isometry3::new(V::new(1.0, 2.0, 3.0), V::new(0.1, 0.2, 0.3));
        found.covariance[(0, 5)] = 0.5;
        found.covariance[(5, 0)] = 0.5;
        found.weak_directions = vec![lattice_core::registration::WeakDirection {
            axis: V::new(0.0, 0.6, 0.8),
            kind: DirectionKind::Rotation,
            sigma: 0.25,
        }];
        let result = result_from(&found);
        assert_eq!(result.verdict, CalibrationResult::DEGENERATE);
        assert_eq!((&*result.reason, &*result.method), ("slides", "none"));
        let pose = isometry_from_transform(&result.transform).unwrap();
        assert!((pose.to_homogeneous() - found.target_from_source.to_homogeneous()).norm() < 1e-12);
        assert_eq!((result.covariance[5], result.covariance[30]), (0.5, 0.5));
        assert_eq!(result.weak_directions[0].kind, WeakDirection::ROTATION);
        assert_eq!(result.weak_directions[0].axis.z, 0.8);
        found.cancelled = true;
        assert_eq!(result_from(&found).verdict, CalibrationResult::NONE);
    }
}
