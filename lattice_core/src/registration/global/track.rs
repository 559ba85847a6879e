//! Following a headset that is already calibrated.

use nalgebra::Isometry3;

use super::candidates::RegistrationContext;
use super::map::CalibrationMap;
use super::request::{CalibrationOptions, CalibrationRequest, SourceCloud};
use super::source::PreparedSource;
use super::verdict::is_constrained;

/// Log-likelihood by which a refined pose must be better to replace the old one.
const BETTER: f64 = 2.0;

/// Verdict of a further scan on a pose.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct TrackUpdate {
    /// True if the scan fits; a full search is due when several in a row do not.
    pub fits: bool,
    /// `target_from_source` after the look; as before if it does not fit.
    pub target_from_source: Isometry3<f64>,
    /// Share of the points on a surface of the map.
    pub inlier_fraction: f64,
    /// Root mean square distance of those from the surfaces, metres.
    pub rmse_m: f64,
}

/// Refines a known pose by one more look, cheaply: nothing is searched.
///
/// A look that does not hold the pose in all directions, as one at a wall alone, tells no more than whether it fits:
/// otherwise one after the other would drag the pose along what they do not see.
/// A look that cannot be used fits as little as one from elsewhere.
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
    let is_better = new.total() > old.total() + BETTER;
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
