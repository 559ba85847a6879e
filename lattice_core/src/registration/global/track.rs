//! Tracking of a known pose by further clouds.

use nalgebra::Isometry3;

use super::candidates::RegistrationContext;
use super::error_model::is_constrained;
use super::map::CalibrationMap;
use super::request::{CalibrationOptions, CalibrationRequest, SourceCloud};
use super::source::PreparedSource;

/// Log-likelihood ratio above which a refined pose replaces the known one.
const REPLACE_LEAD: f64 = 2.0;

/// Result of tracking a pose with one cloud.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct TrackUpdate {
    /// True if the inlier fraction reaches its limit; after several failures in a row, a global registration is due.
    pub fits: bool,
    /// Updated `target_from_source`; unchanged if the cloud does not fit.
    pub target_from_source: Isometry3<f64>,
    /// Fraction of inliers.
    pub inlier_fraction: f64,
    /// RMS distance of the inliers from the surfaces, metres.
    pub rmse_m: f64,
}

/// Refines a known pose with one more cloud, without a search.
///
/// A cloud that does not constrain the pose in all directions, such as a single wall, updates only the fit:
/// successive updates would drift along the weak directions. An unusable cloud counts as one that does not fit.
pub fn track(
    map: &CalibrationMap,
    source_cloud: &SourceCloud,
    target_from_source: &Isometry3<f64>,
    options: &CalibrationOptions,
) -> TrackUpdate {
    let request = CalibrationRequest {
        source_clouds: std::slice::from_ref(source_cloud),
        start: None,
        confusion: None,
    };
    let Ok(source) = PreparedSource::new(&request, options, map.spacing_m) else {
        return TrackUpdate {
            fits: false,
            target_from_source: *target_from_source,
            inlier_fraction: 0.0,
            rmse_m: 0.0,
        };
    };
    let context = RegistrationContext::new(map, &source, options, None);
    let old = context.evaluate(&context.fit, *target_from_source, "tracking");
    let pose = context.refine_wide_gate(target_from_source);
    let new = context.evaluate(&context.fit, pose, "tracking");
    let is_better = new.total() > old.total() + REPLACE_LEAD;
    let best = match is_better && is_constrained(&context, &new) {
        true => new,
        false => old,
    };
    let fits = best.inlier_fraction >= options.min_inliers;
    TrackUpdate {
        fits,
        target_from_source: match fits {
            true => best.target_from_source,
            false => *target_from_source,
        },
        inlier_fraction: best.inlier_fraction,
        rmse_m: best.rmse_m,
    }
}
