//! Single registrations of `lattice calibrate --method`.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use lattice_core::registration::{
    HeadsetScan, NamedMethod, PrepareOptions, PreparedCloud, RegisterOptions, Registration,
    SemanticCloud, register, voxel_downsample,
};
use nalgebra::Isometry3;
use std::time::Instant;

use super::answer::Times;
use super::milliseconds;

/// Gate of the methods for which none is published, metres.
const GATE_M: f64 = 1.0;

/// A way to calibrate: by search and judgement, or by a single registration.
#[derive(Clone, Copy, Debug)]
pub struct MethodName(Option<&'static NamedMethod>);

impl MethodName {
    /// The values of `--method` with their help.
    pub fn parser() -> impl TypedValueParser<Value = MethodName> {
        let auto = PossibleValue::new("auto").help("Search, several registrations, one judge");
        let single = |method: &NamedMethod| PossibleValue::new(method.option).help(method.help);
        let values = std::iter::once(auto).chain(NamedMethod::ALL.iter().map(single));
        PossibleValuesParser::new(values)
            .map(|option: String| MethodName(NamedMethod::ALL.iter().find(|m| m.option == option)))
    }

    /// The value of `--method`.
    pub fn name(self) -> &'static str {
        self.0.map_or("auto", |method| method.option)
    }

    /// The registration, if it is a single one.
    pub fn single(self) -> Option<RegisterOptions<'static>> {
        self.0.map(|method| method.options(GATE_M))
    }
}

/// One registration of a cloud that is thinned to the cells of the map.
pub struct Single {
    /// Options of the registration.
    pub method: RegisterOptions<'static>,
    /// Gate in place of the method's own, metres.
    pub gate_m: Option<f64>,
    pub cell_side_m: f64,
}

impl Single {
    /// Prepares both clouds and registers; also the number of points left of the cloud.
    pub fn register(
        &self,
        map: SemanticCloud,
        headset_scans: Vec<HeadsetScan>,
        start: &Isometry3<f64>,
        times: &mut Times,
    ) -> Result<(Registration, usize), String> {
        let started = Instant::now();
        let prepare = PrepareOptions::default();
        let map = PreparedCloud::new(map, &prepare).map_err(|e| format!("the map: {e}"))?;
        times.map_ms = milliseconds(started);
        let started = Instant::now();
        let cloud = voxel_downsample(&together(headset_scans), self.cell_side_m);
        let cloud = PreparedCloud::new(cloud, &prepare).map_err(|e| format!("the cloud: {e}"))?;
        let options = RegisterOptions {
            gate_m: self.gate_m.unwrap_or(self.method.gate_m),
            ..self.method
        };
        let registration = register(&cloud, &map, start, &options);
        times.calibrate_ms = milliseconds(started);
        Ok((registration, cloud.len()))
    }
}

/// All headset scans as one cloud; points of headset scans without labels are unlabelled.
fn together(headset_scans: Vec<HeadsetScan>) -> SemanticCloud {
    let labelled = headset_scans
        .iter()
        .any(|headset_scan| !headset_scan.cloud.labels.is_empty());
    let mut all = SemanticCloud::default();
    for HeadsetScan { cloud, .. } in headset_scans {
        if labelled {
            all.labels.extend((0..cloud.len()).map(|i| cloud.label(i)));
        }
        all.points_m.extend(cloud.points_m);
    }
    all
}
