//! Options of the log of the loader.

use lattice_bag::Storage;
use std::path::PathBuf;

/// Options of a simulated log.
#[derive(Clone, Debug)]
pub struct BobcatOptions {
    /// Seed of all noise; the same seed gives the same messages.
    pub seed: u64,
    /// Length of the log, s.
    pub duration_s: f64,
    /// Time of the tour at which it begins, s.
    pub begin_s: f64,
    /// A person who walks through the yard.
    pub person: bool,
    /// True for the scans of the lasers (LaserScan) in place of clouds (PointCloud2).
    pub scans: bool,
    /// Constant error of the INS: east, north, up in m, then about up in degrees.
    pub ins_offset: [f64; 4],
    /// Storage of the bag.
    pub storage: Storage,
    /// Directory of the bag.
    pub out: PathBuf,
    /// True to replace an earlier log at `out`.
    pub overwrite: bool,
}
