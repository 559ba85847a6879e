//! Findings of a set of facts, each with its remedy.

mod graph;
mod machine;
mod network;
mod time;

#[cfg(test)]
mod tests;

use serde::Serialize;

use super::facts::Facts;

/// Severity of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "UPPERCASE")]
pub enum Severity {
    /// Messages do not arrive, or are wrong.
    Error,
    /// Works now, and fails in other circumstances.
    Warn,
    /// Costs performance.
    Info,
}

impl Severity {
    /// Word of the page.
    pub fn name(self) -> &'static str {
        match self {
            Severity::Error => "ERROR",
            Severity::Warn => "WARN",
            Severity::Info => "INFO",
        }
    }
}

/// A problem with its remedy.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    pub severity: Severity,
    /// The check, in a word or two.
    pub check: &'static str,
    pub problem: String,
    pub remedy: String,
}

impl Finding {
    fn new(
        severity: Severity,
        check: &'static str,
        problem: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self {
            severity,
            check,
            problem: problem.into(),
            remedy: remedy.into(),
        }
    }
}

/// All findings, the most severe first.
pub fn findings(facts: &Facts) -> Vec<Finding> {
    let mut all = network::findings(facts);
    all.extend(graph::findings(facts));
    all.extend(time::findings(facts));
    all.extend(machine::findings(facts));
    all.sort_by_key(|finding| finding.severity);
    all
}

/// Names in a sentence: the first few, and how many more.
fn list<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    const SHOWN: usize = 4;
    let names: Vec<&str> = names.into_iter().collect();
    let shown = names.iter().take(SHOWN).copied().collect::<Vec<_>>();
    match names.len().saturating_sub(SHOWN) {
        0 => shown.join(", "),
        more => format!("{} and {more} more", shown.join(", ")),
    }
}
