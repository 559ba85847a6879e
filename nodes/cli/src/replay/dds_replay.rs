//! Settings of a replay over DDS.

use std::path::Path;

use lattice_bag::BagReader;
use lattice_core::lattice::Lattice;
use lattice_nodes::replay::TopicPlan;
use lattice_runtime::LoopbackDomain;

use super::Replay;

/// A replay over DDS.
pub struct DdsReplay<'a> {
    /// Options of the command.
    pub options: &'a Replay,
    /// The log.
    pub reader: &'a BagReader,
    /// Roles of its topics.
    pub plan: &'a TopicPlan,
    /// Lattices, one map each.
    pub lattices: Vec<Lattice>,
    /// Domain of the processes.
    pub domain: LoopbackDomain,
}

/// Parameter in the form of `-p`.
pub fn param(name: &str, value: &str) -> String {
    format!("{name}:={value}")
}

/// Path as YAML text.
pub fn yaml_text(path: &Path) -> String {
    format!("'{}'", path.display().to_string().replace('\'', "''"))
}

/// Names as a YAML list.
pub fn quoted(names: &[&str]) -> String {
    let names: Vec<String> = names.iter().map(|name| format!("'{name}'")).collect();
    format!("[{}]", names.join(", "))
}
