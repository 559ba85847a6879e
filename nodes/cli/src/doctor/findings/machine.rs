//! Disks and buffers.

use super::super::facts::{Facts, MapDir};
use super::Finding;
use super::Severity::{Error, Info};

/// Free bytes that a map may need.
const ENOUGH_DISK: u64 = 100 << 20;

/// `net.core.rmem_max` for two of the largest messages, bytes; the kernel grants the double.
const ENOUGH_BUFFER: u64 = 8 << 20;

pub fn findings(facts: &Facts) -> Vec<Finding> {
    let mut found: Vec<Finding> = facts.map_dirs.iter().filter_map(disk).collect();
    let short = facts
        .machine
        .rmem_max
        .filter(|bytes| *bytes < ENOUGH_BUFFER);
    if let Some(bytes) = short.filter(|_| facts.network.is_dds()) {
        found.push(Finding::new(
            Info,
            "buffers",
            format!(
                "net.core.rmem_max is {bytes} bytes: clouds above {} bytes may be lost",
                bytes
            ),
            format!("sudo sysctl -w net.core.rmem_max={}", 4 * ENOUGH_BUFFER),
        ));
    }
    found
}

fn disk(of: &MapDir) -> Option<Finding> {
    let free = of.free_bytes.filter(|bytes| *bytes < ENOUGH_DISK)?;
    Some(Finding::new(
        Error,
        "disk",
        format!(
            "the disk of map_dir {} ({}) has {:.1} MB free: maps cannot be saved",
            of.path.display(),
            of.node,
            free as f64 * 1e-6
        ),
        "delete files there, or set map_dir to a folder on another disk",
    ))
}
