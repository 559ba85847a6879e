//! Single registrations of `lattice calibrate --method`.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use lattice_core::registration::{
    NamedMethod, PrepareOptions, PreparedCloud, RegisterOptions, Registration, SemanticCloud,
    SourceCloud, register, voxel_downsample,
};
use nalgebra::Isometry3;
use std::time::Instant;

use super::answer::Times;
use super::milliseconds;

/// Default gate of methods without a published one, metres.
const GATE_M: f64 = 1.0;

/// Calibration method: search with a verdict, or a single registration.
#[derive(Clone, Copy, Debug)]
pub struct MethodName(Option<&'static NamedMethod>);

impl MethodName {
    /// Values of `--method` with their help.
    pub fn parser() -> impl TypedValueParser<Value = MethodName> {
        let auto = PossibleValue::new("auto").help("Search, several registrations, and a verdict");
        let single = |method: &NamedMethod| PossibleValue::new(method.option).help(method.help);
        let values = std::iter::once(auto).chain(NamedMethod::ALL.iter().map(single));
        PossibleValuesParser::new(values)
            .map(|option: String| MethodName(NamedMethod::ALL.iter().find(|m| m.option == option)))
    }

    /// Value of `--method`.
    pub fn name(self) -> &'static str {
        self.0.map_or("auto", |method| method.option)
    }

    /// Single registration of the method, if any, with the given gate.
    pub fn single(self, gate_m: Option<f64>) -> Option<RegisterOptions<'static>> {
        let mut options = self.0?.options(GATE_M);
        options.gate_m = gate_m.unwrap_or(options.gate_m);
        Some(options)
    }
}

/// Registers the cloud, thinned to the cells of the map; returns also the number of remaining points.
pub fn register_once(
    method: &RegisterOptions,
    (map, cell_side_m): (SemanticCloud, f64),
    headset_scans: &[SourceCloud],
    start: &Isometry3<f64>,
    times: &mut Times,
) -> Result<(Registration, usize), String> {
    let started = Instant::now();
    let prepare = PrepareOptions::default();
    let map = PreparedCloud::new(map, &prepare).map_err(|e| format!("the map: {e}"))?;
    times.map_ms = milliseconds(started);
    let started = Instant::now();
    let cloud = voxel_downsample(&together(headset_scans), cell_side_m);
    let cloud = PreparedCloud::new(cloud, &prepare).map_err(|e| format!("the cloud: {e}"))?;
    let registration = register(&cloud, &map, start, method);
    times.calibrate_ms = milliseconds(started);
    Ok((registration, cloud.len()))
}

/// All scans as one cloud; points of scans without labels are unlabelled.
fn together(headset_scans: &[SourceCloud]) -> SemanticCloud {
    let labelled = headset_scans.iter().any(|s| !s.cloud.labels.is_empty());
    let mut all = SemanticCloud::default();
    for SourceCloud { cloud, .. } in headset_scans {
        if labelled {
            all.labels.extend((0..cloud.len()).map(|i| cloud.label(i)));
        }
        all.points_m.extend(&cloud.points_m);
    }
    all
}
