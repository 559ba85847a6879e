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
    "headset_frame" fixed(FRAME): "Frame that the headset's clouds must be in: its origin.";
    "headset_axes" fixed(FRAME): "Axes of the clouds: ros_flu (forward, left, up), unity_ruf (right, up, forward; left-handed), winrt_rub (right, up, backward) or optical (right, down, forward). Gravity must be along down.";
    "max_cloud_points": "Clouds of more points are refused.";
    "max_range_m": "Points farther from the origin of the headset are left out.";
    "require_labels": "Whether clouds without labels are refused; otherwise they are searched by surfaces alone.";
    "max_map_voxels": "Maps of more voxels are not followed.";
    "search": "When a whole search begins by itself: lost (with a cloud, as long as it is not known where the headset is) or asked (only when a client asks).";
    "when_busy": "A request while another is at work: reject (it is refused) or supersede (it takes its place).";
    "max_headset_scans": "Clouds of one session that are searched with together.";
    "headset_scan_period_s": "A cloud replaces the one before unless it is later by this.";
    "track": "Whether the pose is refined by each cloud once it is known.";
    "lost_after": "Searches that must fail in a row before a known pose is given up.";
    "doubt_below": "A cloud is searched with alone if its share of points on the map is below this share of that of the calibration: it may be mirrored, or the headset elsewhere.";
    "map_refresh_s": "How long clouds are compared with an old state of a map that changes.";
    "profile" fixed("the defaults of others follow from it"): "Sensor of the clouds: headset, lidar (may lean), depth_camera, or auto for what range, density and noise of each cloud tell; the defaults of the parameters of the search follow from it.";
    "min_points": "Fewest points of a search.";
    "registered_points": "About how many points are registered; more are thinned.";
    "noise_m": "Standard deviation of the headset's points.";
    "region_m": "Standard deviation of the place of whole regions of them, and side of such regions.";
    "scale_sigma": "Standard deviation of the headset's scale.";
    "max_scale_error": "Share by which the scale of a cloud may differ from 1 for it to be OK.";
    "estimate_scale": "Whether clouds of any scale are scaled to the map; the pose is then that of the scaled cloud, and track, which scales nothing, is to be false.";
    "trust_axes": "Whether axes, handedness and scale of the clouds are certain: no others are tried then, which takes a fifth less time or more.";
    "gravity_sigma_rad": "Standard deviation of the tilt between map and headset, as far as gravity tells; 0 if one of them does not know where down is.";
    "agreement": "Share of places where equal class numbers of headset and map are expected to agree before anything was learned; 0 if their numbers have nothing to do with each other.";
    "guess_radius_m": "How far the answer may be from a guess.";
    "guess_yaw_rad": "How far the heading of the answer may be from that of a guess.";
    "max_p_wrong": "Largest probability that another pose is right, for a pose to be OK.";
    "min_inliers": "Share of the points that must lie on the map for it.";
    "max_contradicted": "Share of the lines of sight that may end before a surface of the map, with nothing of it there, or go through one.";
    "max_sigma_m": "Most standard deviation of a place in its least sure direction for it.";
    "max_sigma_rad": "Most standard deviation of a rotation about any axis for it.";
    "tf_rate_hz": "How often /tf map -> headset_origin is published while it is known.";
    "threads" fixed("the pool is made with it"): "Threads that search; 0: one less than the machine has.";
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
            limits: ComputeLimits {
                events: options::inbox_events(params, 4096)?,
                bytes: options::inbox_bytes(params, 256 << 20)?,
                threads: 1,
            },
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
