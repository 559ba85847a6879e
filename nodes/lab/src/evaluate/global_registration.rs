//! Global registration of clouds in a map.

use lattice_core::registration::{
    Calibration, CalibrationMap, CalibrationOptions, CalibrationRequest, SourceCloud,
    register_global,
};
use nalgebra::Isometry3;

/// Registers clouds of one frame in a map, without labels learned before.
pub(super) fn register(
    map: &CalibrationMap,
    source_clouds: &[SourceCloud],
    start: Option<Isometry3<f64>>,
    options: &CalibrationOptions,
) -> Calibration {
    let request = CalibrationRequest {
        source_clouds,
        start,
        confusion: None,
    };
    register_global(map, &request, options, &())
}
