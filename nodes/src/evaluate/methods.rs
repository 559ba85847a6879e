//! What ours is compared with.

use lattice_core::registration::{
    LabelUse, PreparedCloud, RegisterOptions, SemanticVariant, register,
};
use nalgebra::Isometry3;

/// Gate of the methods for which none is published, metres.
const GATE_M: f64 = 1.0;

/// Least points of a class for the class-wise method: published are 400 for laser scans; a view of a
/// headset has some 1500 points, and few of its classes would be left.
const MIN_CLASS_POINTS: usize = 30;

/// A registration from a start, or the start as it is.
#[derive(Clone, Copy, Debug)]
pub struct Baseline {
    /// Name in results.
    pub name: &'static str,
    /// Name in reports.
    pub title: &'static str,
    options: Option<RegisterOptions<'static>>,
}

impl Baseline {
    /// All of them, in the order of the tables.
    pub fn all() -> Vec<Baseline> {
        let of = |name, title, options| Baseline {
            name,
            title,
            options,
        };
        let semantic = RegisterOptions::semantic;
        let published = SemanticVariant::Published;
        vec![
            of("start", "start", None),
            of("icp", "ICP", Some(RegisterOptions::point_to_point(GATE_M))),
            of("gicp", "GICP", Some(RegisterOptions::gicp(GATE_M))),
            of("gicp_se3", "GICP-SE(3)", Some(RegisterOptions::gicp_se3())),
            of(
                "semantic_hard",
                "Semantic-ICP, hard",
                Some(semantic(published, LabelUse::Hard)),
            ),
            of(
                "semantic_soft",
                "Semantic-ICP, soft",
                Some(semantic(published, LabelUse::Soft)),
            ),
            of(
                "em_hard",
                "Semantic-ICP, EM",
                Some(RegisterOptions::semantic_em(GATE_M, LabelUse::Hard)),
            ),
            of(
                "class_wise",
                "class-wise 2017",
                Some(RegisterOptions {
                    min_class_points: MIN_CLASS_POINTS,
                    ..RegisterOptions::class_wise()
                }),
            ),
        ]
    }

    /// Where it ends.
    pub fn run(
        &self,
        source: &PreparedCloud,
        target: &PreparedCloud,
        start: &Isometry3<f64>,
    ) -> Isometry3<f64> {
        match &self.options {
            Some(options) => register(source, target, start, options).target_from_source,
            None => *start,
        }
    }
}
