//! Parameters of the server.

use std::time::Duration;

use super::ServerOptions;
use crate::compute::ComputeLimits;
use crate::options::{self, FRAME};
use crate::report;
use lattice_runtime::about;
use lattice_runtime::params::{About, ParamError, Params};

const ABOUT: &[About] = about! {
    "map_frame" fixed(FRAME): "Frame of the map.";
    "headset_frame" fixed(FRAME): "Required frame of the headset's clouds: its origin.";
    "headset_axes" fixed(FRAME): "Axis convention of the clouds: ros_flu (forward, left, up), unity_ruf (right, up, forward; left-handed), winrt_rub (right, up, backward) or optical (right, down, forward). Gravity must be along down.";
    "max_range_m": "Points farther from the origin of the headset are rejected.";
    "require_labels": "Whether clouds without labels are rejected; otherwise they are registered by geometry only.";
    "max_map_voxels": "Voxel limit of the followed map.";
    "search": "Condition for a search without a request: lost (at each cloud while the headset's pose is unknown) or asked (never).";
    "when_busy": "Policy for a request while another is in progress: reject, or supersede (cancel the earlier one).";
    "max_headset_scans": "Limit of clouds of one session per search.";
    "headset_scan_period_s": "Time within which a cloud replaces the previous one.";
    "track": "Whether a known pose is refined by each cloud.";
    "lost_after": "Consecutive failed searches before a known pose is dropped.";
    "doubt_below": "Inlier fraction, relative to that of the calibration, below which a cloud is searched alone: it may be mirrored, or the headset may have moved.";
    "map_refresh_s": "Longest use of an outdated state of a changing map for tracking.";
    "profile" fixed("the defaults of others follow from it"): "Sensor of the clouds: headset, lidar (may lean), depth_camera, or auto (detected from range, density and noise of each cloud); it sets the defaults of the search parameters.";
    "min_points": "Smallest number of points of a search.";
    "registered_points": "Approximate number of registered points; larger clouds are thinned.";
    "noise_m": "Standard deviation of the headset's points.";
    "region_m": "Standard deviation of correlated position errors within a region of points, and the size of a region.";
    "scale_sigma": "Standard deviation of the headset's scale.";
    "max_scale_error": "Largest deviation of the scale from 1 for OK, as a fraction.";
    "estimate_scale": "Whether the scale of clouds is estimated; the pose is then that of the scaled cloud, and track, which estimates no scale, must be false.";
    "trust_axes": "Whether axis convention and scale of the clouds are certain: no others are tested then, which saves a fifth of the time or more.";
    "gravity_sigma_rad": "Standard deviation of the tilt between map and headset by gravity; 0 if the gravity direction of one of them is unknown.";
    "agreement": "Prior fraction of places where equal class numbers of headset and map agree; 0 if the numbers are unrelated.";
    "guess_radius_m": "Largest distance of the result from a guess.";
    "guess_yaw_rad": "Largest heading difference of the result from a guess.";
    "max_p_wrong": "Largest probability of error for OK.";
    "min_inliers": "Smallest inlier fraction for OK.";
    "max_contradicted": "Largest fraction of contradicted lines of sight for OK: those that end before a surface of the map, or pass through one.";
    "max_sigma_m": "Largest standard deviation of the position in its weakest direction for OK.";
    "max_sigma_rad": "Largest standard deviation of a rotation about any axis for OK.";
    "tf_rate_hz": "Rate of /tf map -> headset_origin while it is known.";
    "threads" fixed("the pool is made with it"): "Search threads; 0: one less than the number of cores.";
};

/// Settings from the parameters of the node.
pub(super) struct Settings {
    pub server: ServerOptions,
    pub limits: ComputeLimits,
    pub search_threads: usize,
    pub tf_period: Duration,
    pub mapper: String,
    pub report_file: String,
}

impl Settings {
    /// Reads the parameters of the node.
    pub(super) fn from_params(params: &Params) -> Result<Self, ParamError> {
        params.describe(ABOUT);
        params.describe(options::COMMON);
        let rate_hz = params.f64_in("tf_rate_hz", 10.0, 0.1..=100.0)?;
        Ok(Self {
            server: ServerOptions::from_params(params)?,
            limits: options::compute_limits(params, 4096, 256 << 20, 1)?,
            search_threads: options::threads(params, 0)?,
            tf_period: Duration::from_secs_f64(1.0 / rate_hz),
            mapper: params.string("mapper", "lattice_mapper")?,
            report_file: report::file(params)?,
        })
    }
}

/// Declares all parameters of the node, as at its start.
pub fn declare(params: &Params) -> Result<(), ParamError> {
    Settings::from_params(params).map(drop)
}
