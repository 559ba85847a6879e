//! What ours is compared with.

use lattice_core::registration::{
    LabelUse, Method, PreparedCloud, RegisterOptions, SemanticVariant, register,
};
use nalgebra::Isometry3;

/// Gate of the methods for which none is published, metres.
const GATE_M: f64 = 1.0;

/// A registration from a start, or the start as it is.
#[derive(Clone, Copy, Debug)]
pub struct Baseline {
    /// Name in results.
    pub name: &'static str,
    /// Name in reports.
    pub title: &'static str,
    options: Option<RegisterOptions<'static>>,
}

/// The points of the headset, made ready.
pub struct Sources<'a> {
    /// Thinned to the cells of the map.
    pub thinned: &'a PreparedCloud,
    /// All of them, for the class-wise method of 2017: it leaves out classes of fewer than 400 points, which would
    /// be nearly all of the thinned ones.
    pub full: &'a PreparedCloud,
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
                Some(RegisterOptions::class_wise()),
            ),
            of(
                "class_wise_cauchy",
                "class-wise, Cauchy",
                Some(RegisterOptions::class_wise_cauchy()),
            ),
        ]
    }

    /// Where it ends.
    pub fn run(
        &self,
        sources: &Sources<'_>,
        target: &PreparedCloud,
        start: &Isometry3<f64>,
    ) -> Isometry3<f64> {
        match &self.options {
            Some(options) => {
                let source = match options.method {
                    Method::ClassWise if options.kernel_of_square => sources.full,
                    _ => sources.thinned,
                };
                register(source, target, start, options).target_from_source
            }
            None => *start,
        }
    }
}
