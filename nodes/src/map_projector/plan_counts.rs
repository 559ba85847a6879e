//! Counters of the planner.

use serde::{Deserialize, Serialize};

/// Goals by their ends.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlanCounts {
    /// Paths found.
    pub plans_out: u64,
    /// Goals without a path.
    pub plans_failed: u64,
    /// Goals that a client canceled.
    pub plans_canceled: u64,
}
