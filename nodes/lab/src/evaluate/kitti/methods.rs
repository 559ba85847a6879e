//! What is compared.

use lattice_core::registration::{LabelUse, RegisterOptions, SemanticVariant};

/// Name of ours in reports.
pub const OURS_TITLE: &str = "**ours**";

/// A way to register two scans.
#[derive(Clone, Copy, Debug)]
pub enum KittiMethod {
    /// The start as it is.
    Start,
    /// One registration from the start.
    Single {
        /// Name in results.
        name: &'static str,
        /// Name in reports.
        title: &'static str,
        /// How.
        options: RegisterOptions<'static>,
    },
    /// A calibration, the start being known or not.
    Ours {
        /// Whether the moved scan is thinned before, as for all others; it is thinned in any case.
        thinned: bool,
    },
}

impl KittiMethod {
    /// All of them, in the order of the table. Where no gate is published it is 1 m and 2 m.
    ///
    /// `thinned` is whether ours gets a thinned scan.
    pub fn all(thinned: bool) -> Vec<KittiMethod> {
        let of = |name, title, options| KittiMethod::Single {
            name,
            title,
            options,
        };
        let semantic = RegisterOptions::semantic;
        let published = SemanticVariant::Published;
        vec![
            KittiMethod::Start,
            of("icp_1", "ICP, 1 m", RegisterOptions::point_to_point(1.0)),
            of("icp_2", "ICP, 2 m", RegisterOptions::point_to_point(2.0)),
            of("gicp_1", "GICP, 1 m", RegisterOptions::gicp(1.0)),
            of("gicp_2", "GICP, 2 m", RegisterOptions::gicp(2.0)),
            of(
                "gicp_se3",
                "GICP-SE(3), 15.8 m",
                RegisterOptions::gicp_se3(),
            ),
            of(
                "semantic_hard",
                "Semantic-ICP as published, hard labels",
                semantic(published, LabelUse::Hard),
            ),
            of(
                "semantic_soft",
                "Semantic-ICP as published, soft labels",
                semantic(published, LabelUse::Soft),
            ),
            of(
                "as_printed",
                "Semantic-ICP as printed, hard labels",
                semantic(SemanticVariant::AsPrinted, LabelUse::Hard),
            ),
            of(
                "em_hard",
                "Semantic-ICP, EM, hard labels, 2 m",
                RegisterOptions::semantic_em(2.0, LabelUse::Hard),
            ),
            of(
                "class_wise",
                "class-wise Semantic-ICP of 2017",
                RegisterOptions::class_wise(),
            ),
            KittiMethod::Ours { thinned },
        ]
    }

    /// Name in results.
    pub fn name(&self) -> &'static str {
        match self {
            KittiMethod::Start => "start",
            KittiMethod::Single { name, .. } => name,
            KittiMethod::Ours { .. } => "ours",
        }
    }

    /// Name in reports.
    pub fn title(&self) -> &'static str {
        match self {
            KittiMethod::Start => "the start itself",
            KittiMethod::Single { title, .. } => title,
            KittiMethod::Ours { .. } => OURS_TITLE,
        }
    }
}
