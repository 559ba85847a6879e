//! Error model and covariance of a candidate.

use nalgebra::Isometry3;

use super::calibration::WeakDirection;
use super::candidates::{Candidate, RegistrationContext};
use super::covariance::{ErrorModel, PoseCovariance};

/// Largest ratio of the error of a region to the RMS residual.
pub(super) const MAX_ERROR_RATIO: f64 = 4.0;

/// Typical ratio of the extent of a cloud to the RMS distance of its points from their centroid.
pub(super) const EXTENT: f64 = 3.5;

/// Extent of a large cloud, in regions.
pub(super) const LARGE: f64 = 2.0;

/// Number of smaller regions along the extent of a cloud that is not large.
pub(super) const REGIONS: f64 = 4.0;

/// Tests whether the surfaces constrain a pose in all directions, as the verdict `OK` requires.
pub(super) fn is_constrained(context: &RegistrationContext<'_>, candidate: &Candidate) -> bool {
    let pose = &candidate.target_from_source;
    let covariance = covariance(context, candidate);
    let covariance = covariance
        .and_then(|covariance| covariance.with_gravity(pose, context.options.gravity_sigma_rad));
    covariance.is_some_and(|covariance| weak(context, &covariance, pose).is_empty())
}

/// Directions whose standard deviation exceeds its limit.
pub(super) fn weak(
    context: &RegistrationContext<'_>,
    covariance: &PoseCovariance,
    pose: &Isometry3<f64>,
) -> Vec<WeakDirection> {
    let mut directions = covariance.directions(pose, &context.centroid());
    directions.retain(|d| d.sigma > context.options.max_sigma(d.kind));
    directions
}

/// Covariance of a candidate's pose from the surfaces; `None` if they do not constrain it.
pub(super) fn covariance(
    context: &RegistrationContext<'_>,
    best: &Candidate,
) -> Option<PoseCovariance> {
    let (source, target) = (&context.source.full, &context.map.cloud);
    let model = error_model(context, best);
    PoseCovariance::at(source, target, &best.target_from_source, &model)
}

/// Error model of the source at a candidate's pose.
pub(super) fn error_model(context: &RegistrationContext<'_>, best: &Candidate) -> ErrorModel {
    let options = context.options;
    let extent_m = EXTENT * context.reach_m();
    let is_small = extent_m < LARGE * options.region_m;
    ErrorModel {
        region_m: options.region_m,
        within_m: is_small.then_some(extent_m / REGIONS),
        // A cloud whose residuals are far below the expected noise also has smaller region errors.
        sigma_m: options.noise_m.min(MAX_ERROR_RATIO * best.rmse_m),
        point_m: best.rmse_m,
        spacing_m: context.map.spacing_m,
        scale_sigma: options.scale_sigma,
        center: context
            .source
            .sensor_m
            .unwrap_or_else(|| context.centroid()),
        gate_m: 6.0 * context.map.spacing_m,
    }
}
