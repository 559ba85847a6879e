//! The one line that every benchmark prints, here and in the peers.

use super::Spent;
use lattice_core::lattice::Lattice;
use serde::Serialize;

/// Result of one run of one system.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// System and variant, for example `lattice-occupancy`.
    pub sys: String,
    /// Lattice by name.
    pub lattice: &'static str,
    /// Side of a cube of the cells' volume, m.
    pub res: f64,
    /// Threads that the operation could use.
    pub threads: usize,
    /// Points, or voxels where the operation goes over voxels.
    pub n: u64,
    /// Wall time, s.
    pub wall_s: f64,
    /// Processor time of all threads, s.
    pub cpu_s: f64,
    /// Occupied voxels at the end.
    pub voxels: u64,
    /// Memory that holds them, bytes; 0 where nothing is stored.
    pub bytes: u64,
    /// Digest of the result where it has one, to compare machines and methods.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hash: Option<String>,
    /// Occupied neighbours or cells visited, where the operation counts them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub count: Option<u64>,
}

impl Report {
    /// A report without digest or count.
    pub(super) fn new(sys: impl Into<String>, lattice: &Lattice, spent: Spent) -> Self {
        Self {
            sys: sys.into(),
            lattice: lattice.kind().name(),
            // As it was asked for, before it was a volume.
            res: (lattice.cell_side_m() * 1e9).round() / 1e9,
            threads: rayon::current_num_threads(),
            n: 0,
            wall_s: spent.wall_s,
            cpu_s: spent.cpu_s,
            voxels: 0,
            bytes: 0,
            hash: None,
            count: None,
        }
    }
}
