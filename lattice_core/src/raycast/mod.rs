//! Free space: traversal of rays through cells and occupancy evidence.
//!
//! Rays are followed through the cells of any lattice, exactly. [`FreeSpaceMap`] accumulates scans to occupied, free
//! and unknown cells. [`RayClearer`] removes voxels that rays traverse from a store.

mod blocks;
mod clear;
mod coarse;
mod evidence;
mod families;
mod free_space_options;
mod map;
mod marks;
mod masks;
mod packed;
mod rays;
mod scan;
mod steps;
mod surface;
mod traversal;

pub use clear::{ClearOptions, ClearReport, RayClearer};
pub use evidence::{Evidence, EvidenceError, LOG_ODDS_STEP};
pub use free_space_options::{FreeSpaceError, FreeSpaceOptions, MAX_FREE_LEVEL, MIN_MAP_BYTES};
pub use map::FreeSpaceMap;
pub use scan::{RayBundle, Reach, ScanReport};
