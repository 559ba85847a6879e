//! Scale of a source cloud, estimated with its pose.

use nalgebra::{Isometry3, Matrix3, Matrix3x6, OMatrix, Point3, SMatrix, SVector, U7, Vector3};
use std::collections::BTreeMap;

use super::super::PreparedCloud;
use super::super::likelihood::region_of;
use super::calibration::{Calibration, ScaleEstimate};
use super::covariance::{ErrorModel, KERNEL};
use super::request::{CalibrationRequest, SourceCloud};
use crate::pose::se3;

/// Steps of Gauss and Newton, with new partners before each.
const STEPS: usize = 10;
/// Change of the scale below which a step is none.
const STILL: f64 = 1e-4;
/// Calibrations that a scale may take.
const ROUNDS: usize = 3;
/// Difference from 1 that is not worth another calibration.
const LEAST: f64 = 0.003;
/// Standard deviation of a scale that was only tried.
const ROUGHLY: f64 = 0.03;
/// Log-likelihood that a scale gains which matters, whatever its standard deviation.
const CLEAR_GAIN: f64 = 40.0;
/// Scales that are believed to be of one world.
const SANE: std::ops::Range<f64> = 0.5..2.0;

/// Pose and scale, and what equations at both by region.
#[derive(Default)]
struct NormalEquations7 {
    hessian: OMatrix<f64, U7, U7>,
    regions: BTreeMap<[i64; 3], (SVector<f64, 7>, SMatrix<f64, 7, 3>)>,
}

/// Pose and scale that fit best together.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct ScaledPose {
    /// Pose of points that keep their distance from the centre of the model, but for the scale.
    pub target_from_source: Isometry3<f64>,
    pub scale: f64,
    /// Standard deviation that regions which err together give the scale.
    pub sigma: f64,
}

/// The scale that fits best near a pose; None if the points do not hold it.
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
        if !SANE.contains(&scale) {
            return None;
        }
        let lever = inverse.row(6);
        let variance = |(residual, motion): &(SVector<f64, 7>, SMatrix<f64, 7, 3>)| {
            let moved = (lever * motion).norm_squared();
            (lever * residual).norm_squared() + model.sigma_m.powi(2) * moved
        };
        let variance: f64 = equations.regions.values().map(variance).sum();
        // What a step still moves is not known.
        let sigma = variance.sqrt().hypot(step[6]);
        last = sigma.is_finite().then_some(ScaledPose {
            target_from_source: pose,
            scale,
            sigma,
        });
        if step[6].abs() < STILL {
            break;
        }
    }
    last
}

/// Calibrates with the points multiplied by their scale, until that is 1.
///
/// `found` is the answer without; the scale of the answer is that of the points as they came.
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

fn scaled(scan: &SourceCloud, by: f64) -> SourceCloud {
    let mut scan = scan.clone();
    let points = scan.cloud.points_m.iter_mut().chain(&mut scan.sensor_m);
    points.for_each(|point| point.coords *= by);
    scan
}

impl ScaleEstimate {
    /// Of a scale that is known only to be about right.
    pub(super) fn about(scale: f64) -> ScaleEstimate {
        ScaleEstimate {
            scale,
            sigma: ROUGHLY,
            gain: 0.0,
        }
    }

    /// True if it is neither 1 nor next to it.
    fn matters(&self) -> bool {
        let off = (self.scale - 1.0).abs();
        off > LEAST && (off > 2.0 * self.sigma || self.gain > CLEAR_GAIN)
    }
}

impl NormalEquations7 {
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

/// A source point and its partner, linearised at a pose and a scale.
struct Term {
    point: Point3<f64>,
    /// Partner minus the point's place.
    residual: Vector3<f64>,
    /// Derivative of that by a motion and a turn on the right of the pose.
    jacobian: Matrix3x6<f64>,
    /// The opposite of its derivative by the scale.
    stretch: Vector3<f64>,
    /// Inverse covariance, times what the kernel leaves of it.
    weight: Matrix3<f64>,
}

/// The points of a source that have a partner near their place.
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

/// Jacobian of q - T p by a motion and a turn on the right of T.
fn jacobian(turn: &Matrix3<f64>, point: &Point3<f64>) -> Matrix3x6<f64> {
    let mut jacobian = Matrix3x6::zeros();
    jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&-turn);
    let lever = turn * point.coords.cross_matrix();
    jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&lever);
    jacobian
}
