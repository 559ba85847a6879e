//! Seed, extent and files of a report.

use std::path::PathBuf;

/// Options of the report.
#[derive(Clone, Debug)]
pub struct Options {
    /// The same seed gives the same bytes.
    pub seed: u64,
    /// Fewer samples and trials.
    pub quick: bool,
    /// Point files of single scans, for Fig. 5.
    pub scans: Vec<PathBuf>,
    /// Logs, for Table I.
    pub bags: Vec<PathBuf>,
    /// Folder of pairs of scans, for Fig. 6.
    pub pairs: Option<PathBuf>,
    /// Further pairs: file of the map's scan, of the scan that is matched, and of its pose in the map.
    pub pair_files: Vec<[PathBuf; 3]>,
}
