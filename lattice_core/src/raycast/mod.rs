//! Free space: which cells a ray passes through, and what scans say about them.
//!
//! Rays are followed through the cells of any lattice, exactly. [`FreeSpaceMap`] adds up scans to
//! occupied, free and unknown cells, [`RayClearer`] removes from a voxel store what rays pass through.

mod blocks;
mod clear;
mod coarse;
mod evidence;
mod families;
mod map;
mod masks;
mod options;
mod packed;
mod scan;
mod traversal;

pub use clear::{ClearOptions, ClearReport, RayClearer};
pub use evidence::{Evidence, EvidenceError};
pub use map::FreeSpaceMap;
pub use options::{FreeSpaceError, FreeSpaceOptions, MAX_FREE_LEVEL, MIN_MAP_BYTES};
pub use scan::{RayBundle, Reach, ScanReport};
