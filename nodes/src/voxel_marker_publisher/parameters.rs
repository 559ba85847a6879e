//! Parameters of the marker publisher.

use std::time::Duration;

use super::MarkerOptions;
use crate::compute::ComputeLimits;
use crate::{options, report};
use lattice_runtime::about;
use lattice_runtime::params::{About, ParamError, Params};
use lattice_runtime::qos::Qos;

const ABOUT: &[About] = about! {
    "style": "Marker style: cells (Voronoi cells, exposed faces only), cubes or points.";
    "color_by": "Colour scheme: height (of each vertex), flat (one colour per marker, 40 % fewer bytes) or color (mean colour of each voxel, where the mapper has keep_color; grey without).";
    "height_period_m": "Height period of the hues.";
    "alpha": "Opacity.";
    "block_bits": "Block size: 2^block_bits lattice indices a side; a change republishes its whole block.";
    "chunk_bytes": "Largest message, bytes.";
    "max_marker_voxels": "Voxel count above which maps are drawn as points.";
    "rate_hz": "Rate of publishing changes.";
    "max_bytes_per_s": "Limit of published bytes per second.";
};

/// Settings from the parameters of the node.
pub(super) struct Settings {
    pub markers: MarkerOptions,
    pub limits: ComputeLimits,
    pub period: Duration,
    /// Byte budget per period.
    pub budget_bytes: usize,
    pub mapper: String,
    pub report_file: String,
}

impl Settings {
    /// Reads the parameters of the node.
    pub(super) fn from_params(params: &Params) -> Result<Self, ParamError> {
        params.describe(ABOUT);
        params.describe(options::COMMON);
        let rate_hz = params.f64_in("rate_hz", 5.0, 0.1..=100.0)?;
        let bytes_per_s = params.positive("max_bytes_per_s", 20_000_000)?;
        let markers = MarkerOptions::from_params(params)?;
        // Two consecutive arrays exceed the size of one, so these fit into the history and the queue.
        let most_bytes = Qos::MARKERS.depth / 2 * markers.chunk_bytes;
        Ok(Self {
            limits: options::compute_limits(params, 4096, 64 << 20, options::threads(params, 1)?)?,
            period: Duration::from_secs_f64(1.0 / rate_hz),
            budget_bytes: ((bytes_per_s as f64 / rate_hz) as usize).min(most_bytes),
            markers,
            mapper: params.string("mapper", "lattice_mapper")?,
            report_file: report::file(params)?,
        })
    }
}

/// Declares all parameters of the node, as at its start.
pub fn declare(params: &Params) -> Result<(), ParamError> {
    Settings::from_params(params).map(drop)
}
