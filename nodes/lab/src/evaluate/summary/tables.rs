//! Rows of the tables.

use crate::evaluate::statistics::Share;
#[cfg(doc)]
use crate::evaluate::trial::WRONG;
use serde::Serialize;
use std::collections::BTreeMap;

/// Published errors of a scene (Nakamura et al. 2019, table 1).
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct Printed {
    pub scene: &'static str,
    /// Published d_SE3 of GICP-SE(3).
    pub gicp_se3: f64,
    /// Published d_SE3 of Semantic-ICP.
    pub semantic_icp: f64,
}

/// Table 1 of the paper.
pub const PRINTED: [Printed; 4] = [
    printed("tv", 0.22, 8.68),
    printed("desk", 5.42, 0.05),
    printed("bookshelf", 0.08, 0.76),
    printed("dining", 0.06, 0.04),
];

const fn printed(scene: &'static str, gicp_se3: f64, semantic_icp: f64) -> Printed {
    Printed {
        scene,
        gicp_se3,
        semantic_icp,
    }
}

/// Results of one method for one scene, fraction of wrong labels and start.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Row {
    pub scene: String,
    pub start: String,
    pub q: f64,
    pub method: String,
    /// Fraction of poses within [`WRONG`].
    pub success: Share,
    pub d_se3: Option<f64>,
    pub d_se3_left: Option<f64>,
    pub translation_m: Option<f64>,
    pub rotation_deg: Option<f64>,
    /// Median of the mean distance of the seen points, metres.
    pub view_m: Option<f64>,
}

/// Comparison of Lattice with another method from the same starts.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Paired {
    pub against: String,
    pub start: String,
    pub q: Option<f64>,
    /// Fraction of trials with errors at most 1 cm and 0.2 degrees above those of the other method.
    pub not_worse: Share,
    /// Fraction of these trials, and of those in which only Lattice is right.
    pub not_worse_or_saved: Share,
    /// Fraction of trials with a mean distance of the seen points at most 1 cm above that of the other method.
    pub not_worse_in_view: Share,
    /// Fraction of trials in which only Lattice is right.
    pub saved: Share,
    /// Fraction of trials in which only the other method is right.
    pub spoiled: Share,
}

/// Share of accepted poses, and of wrong ones among them.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Accepted {
    pub scene: String,
    pub start: String,
    pub q: Option<f64>,
    pub accepted: Share,
    /// Share of these beyond 0.15 m or 3 degrees.
    pub wrong: Share,
    /// Share of these beyond 0.10 m or 3 degrees.
    pub wrong_tight: Share,
    /// Share of these with seen points on average beyond 0.15 m, or beyond 3 degrees.
    pub wrong_in_view: Share,
    pub right: Share,
    pub verdicts: BTreeMap<String, usize>,
}

/// Normalised squared errors of accepted poses.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Consistency {
    pub start: String,
    pub n: usize,
    /// Mean over 6, where 1 is right.
    pub mean_over_6: Option<f64>,
    /// Median over 5.35, that of six degrees of freedom.
    pub median_over_expected: Option<f64>,
}

/// Wall times of a method.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct TimeRow {
    pub method: String,
    pub start: String,
    pub n: usize,
    pub median_ms: Option<f64>,
    /// 90 % quantile, milliseconds.
    pub p90_ms: Option<f64>,
}
