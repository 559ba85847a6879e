//! Scale of a source cloud, estimated with its pose.

use nalgebra::{Isometry3, Matrix3, Matrix3x6, OMatrix, Point3, SMatrix, SVector, U7, Vector3};
use std::collections::BTreeMap;

use super::super::PreparedCloud;
use super::super::likelihood::{Partners, region_of};
use super::calibration::{Calibration, ScaleEstimate};
use super::candidates::{Candidate, RegistrationContext};
use super::covariance::{ErrorModel, KERNEL};
use super::error_model::error_model;
use super::request::{CalibrationOptions, CalibrationRequest, SourceCloud};
use crate::pose::se3;

/// Maximum number of Gauss-Newton iterations, with new correspondences in each.
const STEPS: usize = 10;
/// Change of the scale at which the iteration has converged.
const CONVERGED: f64 = 1e-4;
/// Maximum number of registrations to find the scale.
const ROUNDS: usize = 3;
/// Difference of the scale from 1 below which no further registration follows.
const NEGLIGIBLE: f64 = 0.003;
/// Standard deviation of a scale from the tested hypotheses.
const TESTED_SIGMA: f64 = 0.03;
/// Log-likelihood gain from which a scale is significant, whatever its standard deviation.
const CLEAR_GAIN: f64 = 40.0;
/// Range of plausible scales.
const PLAUSIBLE: std::ops::Range<f64> = 0.5..2.0;

/// Log-likelihood gain above which another scale is accepted.
const SCALE_GAIN: f64 = 40.0;
/// The same per observation: correct poses on warped meshes gain less than 0.1, clouds with a scale error of 5 % at
/// least 1.
const SCALE_GAIN_PER_OBSERVATION: f64 = 0.3;
/// Largest loss of the inlier fraction at another scale.
const MAX_INLIER_LOSS: f64 = 0.02;
/// RMS distance from surfaces below which differences do not count, metres.
const MIN_RMSE_M: f64 = 1e-3;

/// Normal equations of pose and scale (7 unknowns), with the gradient of each region.
#[derive(Default)]
struct NormalEquations7 {
    hessian: OMatrix<f64, U7, U7>,
    regions: BTreeMap<[i64; 3], (SVector<f64, 7>, SMatrix<f64, 7, 3>)>,
}

/// Jointly estimated pose and scale.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct ScaledPose {
    /// Pose of the unscaled points; the scale applies about the centre of the error model.
    pub target_from_source: Isometry3<f64>,
    pub scale: f64,
    /// Standard deviation of the scale, with correlated errors within regions.
    pub sigma: f64,
}

/// Estimates pose and scale near a pose; `None` if the points do not determine the scale.
pub(super) fn scale_at(
    source: &PreparedCloud,
    target: &PreparedCloud,
    target_from_source: &Isometry3<f64>,
    model: &ErrorModel,
) -> Option<ScaledPose> {
    let (mut pose, mut scale) = (*target_from_source, 1.0);
    let mut last = None;
    for _ in 0..STEPS {
        let equations = NormalEquations7::at(source, target, &pose, scale, model);
        let inverse = equations.hessian.try_inverse()?;
        let gradient: SVector<f64, 7> = equations
            .regions
            .values()
            .map(|(residual, _)| residual)
            .sum();
        let step = -(inverse * gradient);
        let moved = step.fixed_rows::<6>(0).into_owned();
        (pose, scale) = (pose * se3::exp(&moved), scale + step[6]);
        if !PLAUSIBLE.contains(&scale) {
            return None;
        }
        let lever = inverse.row(6);
        let variance = |(residual, motion): &(SVector<f64, 7>, SMatrix<f64, 7, 3>)| {
            let moved = (lever * motion).norm_squared();
            (lever * residual).norm_squared() + model.sigma_m.powi(2) * moved
        };
        let variance: f64 = equations.regions.values().map(variance).sum();
        // The last step bounds the convergence error.
        let sigma = variance.sqrt().hypot(step[6]);
        last = sigma.is_finite().then_some(ScaledPose {
            target_from_source: pose,
            scale,
            sigma,
        });
        if step[6].abs() < CONVERGED {
            break;
        }
    }
    last
}

/// Scale estimated with the pose of a candidate.
pub(super) fn estimate_scale(
    context: &RegistrationContext<'_>,
    best: &Candidate,
) -> Option<ScaleEstimate> {
    let (source, target) = (&context.source.full, &context.map.cloud);
    let model = error_model(context, best);
    let found = scale_at(source, target, &best.target_from_source, &model)?;
    let (pose, scale) = (&found.target_from_source, found.scale);
    let partners = context.fit.partners_scaled(pose, &model.center, scale);
    Some(ScaleEstimate {
        scale,
        sigma: found.sigma,
        gain: gain(context.fit.observations(), best, &partners),
    })
}

/// Log-likelihood gained by another scale, for normally distributed residuals; 0 if points lose their
/// correspondences.
fn gain(observations: f64, best: &Candidate, scaled: &Partners) -> f64 {
    if scaled.inlier_fraction < best.inlier_fraction - MAX_INLIER_LOSS {
        return 0.0;
    }
    let both = scaled.inlier_fraction.min(best.inlier_fraction);
    let closer = (best.rmse_m.max(MIN_RMSE_M) / scaled.rmse_m.max(MIN_RMSE_M)).ln();
    both * observations * closer
}

/// Reason to reject points whose scale differs from that of the map.
pub(super) fn scale_fault(
    scale: Option<ScaleEstimate>,
    observations: f64,
    options: &CalibrationOptions,
) -> Option<String> {
    let ScaleEstimate { scale, sigma, gain } = scale.filter(|_| !options.estimate_scale)?;
    let off = (scale - 1.0).abs() > options.max_scale_error;
    let is_certain = gain > SCALE_GAIN.max(SCALE_GAIN_PER_OBSERVATION * observations);
    (off && is_certain).then(|| {
        let most = 100.0 * options.max_scale_error;
        format!(
            "the cloud fits with its points multiplied by {scale:.3}, standard deviation {sigma:.3}: the scale error \
             exceeds {most:.0} % (`max_scale_error`), check its unit"
        )
    })
}

/// Repeats a registration with the points multiplied by their estimated scale, until that is 1.
///
/// `found` is the result without scaling. The scale of the result refers to the unscaled points.
pub(super) fn register_scaled(
    request: &CalibrationRequest<'_>,
    mut found: Calibration,
    register_global: impl Fn(&CalibrationRequest<'_>) -> Calibration,
) -> Calibration {
    let mut total = 1.0;
    for _ in 0..ROUNDS {
        let Some(left) = found.scale.filter(ScaleEstimate::matters) else {
            break;
        };
        total *= left.scale;
        let source_clouds: Vec<SourceCloud> = (request.source_clouds.iter())
            .map(|scan| scaled(scan, total))
            .collect();
        let request = CalibrationRequest {
            source_clouds: &source_clouds,
            ..*request
        };
        found = register_global(&request);
    }
    if total != 1.0 {
        found.reason = format!("{}; the points were multiplied by {total:.4}", found.reason);
    }
    found.scale = found.scale.map(|left| ScaleEstimate {
        scale: total * left.scale,
        sigma: total * left.sigma,
        ..left
    });
    found
}

/// Multiplies the coordinates of a cloud.
fn scaled(scan: &SourceCloud, by: f64) -> SourceCloud {
    let mut scan = scan.clone();
    let points = scan.cloud.points_m.iter_mut().chain(&mut scan.sensor_m);
    points.for_each(|point| point.coords *= by);
    scan
}

impl ScaleEstimate {
    /// Estimate of a scale from the tested hypotheses.
    pub(super) fn about(scale: f64) -> ScaleEstimate {
        ScaleEstimate {
            scale,
            sigma: TESTED_SIGMA,
            gain: 0.0,
        }
    }

    /// Tests whether the scale differs significantly from 1.
    fn matters(&self) -> bool {
        let off = (self.scale - 1.0).abs();
        off > NEGLIGIBLE && (off > 2.0 * self.sigma || self.gain > CLEAR_GAIN)
    }
}

impl NormalEquations7 {
    /// Accumulates the equations at a pose and a scale.
    fn at(
        source: &PreparedCloud,
        target: &PreparedCloud,
        pose: &Isometry3<f64>,
        scale: f64,
        model: &ErrorModel,
    ) -> NormalEquations7 {
        let mut equations = NormalEquations7::default();
        for term in terms(source, target, pose, scale, model) {
            let mut jacobian = SMatrix::<f64, 3, 7>::zeros();
            jacobian.fixed_columns_mut::<6>(0).copy_from(&term.jacobian);
            jacobian.set_column(6, &-term.stretch);
            let lever = jacobian.transpose() * term.weight;
            equations.hessian += lever * jacobian;
            let region = region_of(&term.point, model.region_m);
            let (residual, motion) = equations.regions.entry(region).or_default();
            *residual += lever * term.residual;
            *motion += lever;
        }
        equations
    }
}

/// Correspondence, linearized at a pose and a scale.
struct Term {
    point: Point3<f64>,
    /// Target point minus the transformed source point.
    residual: Vector3<f64>,
    /// Derivative of the residual by a right perturbation of the pose (rho, phi).
    jacobian: Matrix3x6<f64>,
    /// Negative derivative of the residual by the scale.
    stretch: Vector3<f64>,
    /// Inverse covariance times the weight of the robust kernel.
    weight: Matrix3<f64>,
}

/// Correspondences of the source points within the gate.
fn terms<'a>(
    source: &'a PreparedCloud,
    target: &'a PreparedCloud,
    target_from_source: &'a Isometry3<f64>,
    scale: f64,
    model: &'a ErrorModel,
) -> impl Iterator<Item = Term> + 'a {
    let turn = *target_from_source.rotation.to_rotation_matrix().matrix();
    let points = source.points_m().iter().zip(source.covariances_m2());
    points.filter_map(move |(point, spread)| {
        let stretch = turn * (point - model.center);
        let place = target_from_source * point + (scale - 1.0) * stretch;
        let (j, _) = target.nearest(&place, model.gate_m)?;
        let (q, n) = (target.points_m().get(j)?, target.normals().get(j)?);
        let flat = 1.0 - target.plane_epsilon();
        let c = Matrix3::identity() - flat * n * n.transpose();
        let m = (c + turn * spread * turn.transpose()).try_inverse()?;
        let residual = q - place;
        let kernel = 1.0 / (1.0 + residual.dot(&(m * residual)) / (KERNEL * KERNEL));
        Some(Term {
            point: *point,
            residual,
            jacobian: jacobian(&turn, point),
            stretch,
            weight: m * kernel,
        })
    })
}

/// Jacobian of q - T p by a right perturbation of T (rho, phi).
fn jacobian(turn: &Matrix3<f64>, point: &Point3<f64>) -> Matrix3x6<f64> {
    let mut jacobian = Matrix3x6::zeros();
    jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&-turn);
    let lever = turn * point.coords.cross_matrix();
    jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&lever);
    jacobian
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scale_is_wrong_that_is_beyond_its_bound_and_fits_far_better() {
        let given = CalibrationOptions::default();
        let is_wrong = |scale, gain, options: &CalibrationOptions| {
            let estimate = ScaleEstimate {
                scale,
                sigma: 0.02,
                gain,
            };
            scale_fault(Some(estimate), 500.0, options).is_some()
        };
        assert!(is_wrong(1.053, 300.0, &given) && is_wrong(0.9, 300.0, &given));
        // A bump of a warped mesh is explained a little better by a scale.
        assert!(!is_wrong(1.053, 100.0, &given) && !is_wrong(1.02, 300.0, &given));
        let estimated = CalibrationOptions {
            estimate_scale: true,
            ..given
        };
        assert!(!is_wrong(0.9, 300.0, &estimated));
    }
}
