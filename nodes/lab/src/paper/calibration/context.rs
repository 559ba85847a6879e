//! Testbed and extent of a report, for all of its sections.

use crate::evaluate::{Testbed, Trial};

/// Testbed and options that the sections share.
pub(super) struct Context {
    pub(super) testbed: Testbed,
    /// Trials that were run before.
    pub(super) evaluated: Option<Vec<Trial>>,
    pub(super) seed: u64,
    /// Seed of the first trial.
    pub(super) first_seed: u64,
    pub(super) quick: bool,
    pub(super) threads: usize,
    /// Side of a cell of the robot's map, metres.
    pub(super) cell_side_m: f64,
}
