//! Methods of the chain and the starts of the competitor.

use crate::evaluate::settings::Start;

/// Ours without any labels.
pub(super) const UNLABELLED: &str = "ours_unlabelled";
/// Ours with true labels.
pub(super) const TRUE_LABELS: &str = "ours_true_labels";
/// The competitor, with the starts that it gets.
pub(super) const COMPETITOR: &str = "gicp_se3";
pub(super) const STARTS: [Start; 2] = [
    Start::Off { m: 0.3, deg: 10.0 },
    Start::Off { m: 0.8, deg: 35.0 },
];
