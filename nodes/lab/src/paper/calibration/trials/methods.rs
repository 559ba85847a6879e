//! Methods that are compared.

use crate::evaluate::OURS;

/// Name of GICP-SE(3) in evaluations.
pub const GICP: &str = "gicp_se3";
/// Forms of Semantic-ICP: as published in 2018, class by class as published in 2017, and those pairs under the
/// loss that the paper prints.
pub const SEMANTIC: [&str; 3] = ["semantic_hard", "class_wise", "class_wise_cauchy"];

/// All methods in the order of the tables.
pub fn methods() -> [&'static str; 5] {
    let [a, b, c] = SEMANTIC;
    [GICP, a, b, c, OURS]
}
