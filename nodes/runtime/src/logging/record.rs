//! Time and node of a log record.

use std::time::{SystemTime, UNIX_EPOCH};

pub(super) fn now_ns() -> u128 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.unwrap_or_default().as_nanos()
}

/// Node of a record: the process's node, unless the target is not a module path.
pub(super) fn source<'a>(target: &'a str, node_name: &'a str) -> &'a str {
    const LIBRARIES: [&str; 3] = ["lattice_core", "lattice_msgs", "lattice_nodes"];
    if target.contains("::") || LIBRARIES.contains(&target) {
        node_name
    } else {
        target
    }
}
