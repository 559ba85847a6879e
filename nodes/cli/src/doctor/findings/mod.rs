//! Findings of a set of facts, each with its remedy.

mod finding;
mod graph;
mod machine;
mod network;
mod time;

#[cfg(test)]
mod tests;

use super::facts::Facts;
use finding::list;
pub use finding::{Finding, Severity};

/// All findings, the most severe first.
pub fn findings(facts: &Facts) -> Vec<Finding> {
    let mut all = network::findings(facts);
    all.extend(graph::findings(facts));
    all.extend(time::findings(facts));
    all.extend(machine::findings(facts));
    all.sort_by_key(|finding| finding.severity);
    all
}
