//! Single registrations.

use clap::ValueEnum;
use lattice_core::registration::{
    HeadsetScan, LabelUse, PrepareOptions, PreparedCloud, RegisterOptions, Registration,
    SemanticCloud, SemanticVariant, register, voxel_downsample,
};
use nalgebra::Isometry3;
use std::time::Instant;

use super::answer::Times;
use super::milliseconds;

/// Gate of methods without a published one, metres.
const GATE_M: f64 = 1.0;

/// Methods of calibration.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub enum MethodName {
    /// Search, several registrations, one judge
    Auto,
    /// Point-to-point ICP
    Icp,
    /// Generalized ICP
    Gicp,
    /// GICP on SE(3) with a Cauchy kernel
    GicpSe3,
    /// Semantic-ICP as its authors' program runs, hard labels
    SemanticPublished,
    /// Semantic-ICP as the paper prints it, hard labels
    SemanticPrinted,
    /// Semantic-ICP with normalised weights and outliers, hard labels
    SemanticEm,
    /// Semantic-ICP of 2017, class by class
    ClassWise,
}

impl MethodName {
    /// The name as it is typed.
    pub fn name(self) -> &'static str {
        match self {
            MethodName::Auto => "auto",
            MethodName::Icp => "icp",
            MethodName::Gicp => "gicp",
            MethodName::GicpSe3 => "gicp-se3",
            MethodName::SemanticPublished => "semantic-published",
            MethodName::SemanticPrinted => "semantic-printed",
            MethodName::SemanticEm => "semantic-em",
            MethodName::ClassWise => "class-wise",
        }
    }

    /// The registration, if it is a single one.
    pub fn single(self) -> Option<RegisterOptions<'static>> {
        let semantic = |variant| RegisterOptions::semantic(variant, LabelUse::Hard);
        Some(match self {
            MethodName::Auto => return None,
            MethodName::Icp => RegisterOptions::point_to_point(GATE_M),
            MethodName::Gicp => RegisterOptions::gicp(GATE_M),
            MethodName::GicpSe3 => RegisterOptions::gicp_se3(),
            MethodName::SemanticPublished => semantic(SemanticVariant::Published),
            MethodName::SemanticPrinted => semantic(SemanticVariant::AsPrinted),
            MethodName::SemanticEm => RegisterOptions::semantic_em(GATE_M, LabelUse::Hard),
            MethodName::ClassWise => RegisterOptions::class_wise(),
        })
    }
}

/// One registration of a cloud that is thinned to the cells of the map.
pub struct Single {
    pub method: RegisterOptions<'static>,
    /// In place of the method's own, metres.
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
