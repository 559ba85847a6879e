//! Counters and report of the node.

use serde::{Deserialize, Serialize};

use super::plan_counts::PlanCounts;

/// Counters of messages received and grids published.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ProjectorCounts {
    /// Chunks of `voxel_map`, `voxel_map_updates` and `free` received.
    pub messages_in: u64,
    /// Chunks rejected as malformed or too large.
    pub messages_refused: u64,
    /// Keyframes needed.
    pub gaps: u64,
    /// Grids made for `projected_map`.
    pub grids_out: u64,
    /// Rectangles made for `projected_map_updates`.
    pub updates_out: u64,
    /// Grids not made because the map is too wide for their resolution, or the resolution does not fit the lattice.
    pub grids_refused: u64,
    /// Elevation maps made.
    #[serde(default)]
    pub elevations_out: u64,
    /// Elevation maps not made because they have too many cells.
    #[serde(default)]
    pub elevations_refused: u64,
}

/// Report of a `map_projector`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ProjectorReport {
    /// Counters of the state machine.
    pub counts: ProjectorCounts,
    /// Voxels of the followed map.
    pub voxels: usize,
    /// Cells of the last grid: free, occupied and unknown.
    pub cells: [usize; 3],
    /// Grids, updates and elevation maps dropped by the publishers.
    pub grids_not_published: u64,
    /// Map chunks rejected by a full inbox or overrun before it.
    pub inbox_full: u64,
    /// Map chunks lost on the network.
    pub lost_on_network: u64,
    /// Undecodable samples.
    pub undecodable: u64,
    /// Transforms that are not finite or do not fit the tree.
    pub transforms_refused: u64,
    /// Goals of the planner.
    #[serde(default)]
    pub plans: PlanCounts,
}
