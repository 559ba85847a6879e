//! Options of the odometry.

use lattice_core::cloud::TimeOptions;
use lattice_core::lattice::LatticeKind;
use lattice_runtime::params::{ParamError, Params};

use crate::enu_transformer::{TransformerOptions, time_options};
use crate::options::frame;

/// Options of a [`super::LidarOdometry`].
#[derive(Clone, Debug)]
pub struct LidarOdometryOptions {
    /// Frame in which poses are given.
    pub odom_frame: String,
    /// Frame of the machine.
    pub base_frame: String,
    /// True if `odom_frame` -> `base_frame` is published.
    pub publish_tf: bool,
    /// Points nearer to the sensor are left out, in m.
    pub min_range_m: f64,
    /// Points farther from the sensor are left out, in m.
    pub max_range_m: f64,
    /// Most points of one cloud.
    pub max_cloud_points: usize,
    /// Field, unit and reference of the times of points.
    pub time: TimeOptions,
    /// True if points are moved to where they were at their own time.
    pub deskew: bool,
    /// Lattice of the map of the scans before.
    pub lattice: LatticeKind,
    /// True if loops are sought, for a trajectory that is corrected at its end.
    pub loops: bool,
}

impl Default for LidarOdometryOptions {
    fn default() -> Self {
        Self {
            odom_frame: "odom".into(),
            base_frame: "base_link".into(),
            publish_tf: true,
            min_range_m: 0.0,
            max_range_m: f64::INFINITY,
            max_cloud_points: 4_000_000,
            time: TimeOptions::default(),
            deskew: true,
            lattice: LatticeKind::Fcc,
            loops: false,
        }
    }
}

impl LidarOdometryOptions {
    /// Options for the clouds of a transformer, with poses in its map frame and loops.
    pub fn of(transformer: &TransformerOptions) -> Self {
        Self {
            odom_frame: transformer.map_frame.clone(),
            base_frame: transformer.base_frame.clone(),
            min_range_m: transformer.min_range_m,
            max_range_m: transformer.max_range_m,
            max_cloud_points: transformer.max_cloud_points,
            time: transformer.time.clone(),
            deskew: transformer.deskew,
            loops: true,
            ..Self::default()
        }
    }

    /// Reads the parameters of the node.
    pub fn from_params(params: &Params) -> Result<Self, ParamError> {
        let defaults = Self::default();
        let max_range_m = params.f64_in("max_range_m", 0.0, 0.0..=f64::MAX)?;
        let options = Self {
            odom_frame: frame(params, "odom_frame", &defaults.odom_frame)?,
            base_frame: frame(params, "base_frame", &defaults.base_frame)?,
            publish_tf: params.bool("publish_tf", defaults.publish_tf)?,
            min_range_m: params.f64_in("min_range_m", 0.0, 0.0..=f64::MAX)?,
            max_range_m: match max_range_m > 0.0 {
                true => max_range_m,
                false => f64::INFINITY,
            },
            max_cloud_points: params.positive("max_cloud_points", defaults.max_cloud_points)?,
            time: time_options(params)?,
            deskew: params.bool("deskew", defaults.deskew)?,
            lattice: defaults.lattice,
            loops: defaults.loops,
        };
        if options.min_range_m > options.max_range_m {
            let problem = format!("expected at most `max_range_m`, {max_range_m}");
            return Err(params.invalid("min_range_m", problem));
        }
        Ok(options)
    }
}
