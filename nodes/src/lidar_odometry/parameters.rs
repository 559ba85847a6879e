//! All parameters of the odometry.

use super::LidarOdometryOptions;
use crate::compute::ComputeLimits;
use crate::options::{self, FRAME, TOPIC};
use crate::report;
use lattice_runtime::about;
use lattice_runtime::params::{About, ParamError, Params};

const ABOUT: &[About] = about! {
    "odom_frame" fixed(FRAME): "Frame of the poses; its origin is the machine at the end of the first scan.";
    "map_frame" fixed(FRAME): "Frame of poses corrected by loops: map_frame -> odom_frame and corrections are published, and odometry_ok has all submaps; lattice_mapper then needs follow_corrections. Empty: no loops are sought.";
    "base_frame" fixed(FRAME): "Frame of the machine; the frame of the clouds needs a transform to it.";
    "publish_tf" fixed(TOPIC): "Whether odom_frame -> base_frame is published; false where wheel odometry publishes it.";
    "min_range_m" fixed(MAP): "Points nearer to the sensor are rejected.";
    "max_range_m" fixed(MAP): "Points farther from the sensor are rejected; 0: no limit.";
    "max_cloud_points" fixed(MAP): "Limit of points per cloud; larger clouds are rejected.";
    "deskew" fixed(MAP): "Whether points are motion-compensated by their own times.";
    "time.field" fixed(MAP): "Field of the time of points; empty: time, t, timestamp, offset_time, ts, stamp and the like, with or without a unit behind the name (_ns, _us, _ms, _s).";
    "time.unit" fixed(MAP): "auto, s, ms, us or ns.";
    "time.reference" fixed(MAP): "auto, stamp_start, stamp_end or absolute.";
    "time.max_span_s" fixed(MAP): "Longest time span of one cloud; a longer one indicates a wrong unit and is rejected, single outlying points are dropped.";
};

const MAP: &str = "the map of the scans before is made with it";

/// Settings of the node by its parameters.
pub(super) struct Settings {
    pub odometry: LidarOdometryOptions,
    /// Frame of corrected poses, if loops are sought.
    pub map_frame: Option<String>,
    pub limits: ComputeLimits,
    pub report_file: String,
}

impl Settings {
    /// Reads the parameters of the node.
    pub(super) fn from_params(params: &Params) -> Result<Self, ParamError> {
        params.describe(ABOUT);
        params.describe(options::COMMON);
        let map_frame = params.string("map_frame", "")?;
        let map_frame = map_frame.trim_start_matches('/');
        let mut odometry = LidarOdometryOptions::from_params(params)?;
        odometry.loops = !map_frame.is_empty();
        if map_frame == odometry.odom_frame {
            return Err(params.invalid("map_frame", "expected a frame other than `odom_frame`"));
        }
        Ok(Self {
            odometry,
            map_frame: Some(map_frame.to_owned()).filter(|frame| !frame.is_empty()),
            limits: options::compute_limits(params, 256, 64 << 20, options::threads(params, 0)?)?,
            report_file: report::file(params)?,
        })
    }
}

/// Reads all parameters of the node, as its start does.
pub fn declare(params: &Params) -> Result<(), ParamError> {
    Settings::from_params(params).map(drop)
}
