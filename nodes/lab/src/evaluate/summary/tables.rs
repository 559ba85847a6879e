//! The rows of the tables.

use crate::evaluate::statistics::Share;
#[cfg(doc)]
use crate::evaluate::trial::WRONG;
use serde::Serialize;
use std::collections::BTreeMap;

/// Printed errors of a scene (Nakamura et al. 2019, table 1).
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct Printed {
    pub scene: &'static str,
    /// Printed d_SE3 of GICP-SE(3).
    pub gicp_se3: f64,
    /// d_SE3 of Semantic-ICP.
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

/// One method on one scene with one share of wrong labels from one start.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Row {
    pub scene: String,
    pub start: String,
    pub q: f64,
    pub method: String,
    /// Poses within [`WRONG`].
    pub success: Share,
    pub d_se3: Option<f64>,
    pub d_se3_left: Option<f64>,
    pub translation_m: Option<f64>,
    pub rotation_deg: Option<f64>,
    /// Median of the mean distance of the seen points, metres.
    pub view_m: Option<f64>,
}

/// Ours against another from the same starts.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Paired {
    pub against: String,
    pub start: String,
    pub q: Option<f64>,
    /// Share of trials with distance and angle both within 1 cm and 0.2 degrees of the other's, or smaller.
    pub not_worse: Share,
    /// Share of the same, or ours is right where the other is wrong.
    pub not_worse_or_saved: Share,
    /// Share by the mean distance of the seen points alone, within 1 cm.
    pub not_worse_in_view: Share,
    /// Share in which ours is right and the other wrong.
    pub saved: Share,
    /// Share in which ours is wrong and the other right.
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
