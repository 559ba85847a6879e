//! The occupied voxel list: which cells of a lattice hold points, how many, and where in the cell.
//!
//! Everything that is summed is an integer, so that neither the order of the points nor the number
//! of threads can change a bit, and lists merge exactly.

pub mod codec;
pub mod file;
pub mod set_ops;

mod cells;
mod changes;
mod columns;
mod decay;
mod distortion;
mod exposed;
mod fixed;
mod gather;
mod grow;
mod insert;
mod levels;
mod limit;
mod list;
mod merge;
mod morton;
mod neighbors;
mod occupancy;
mod recent;
mod region;
mod retain;
mod shard;
mod store;
mod table;
mod voxel;
mod wide;

pub use changes::Changes;
pub use columns::{LabelCount, Payload, Stamps};
pub use decay::NoStamps;
pub use distortion::Distortion;
pub use insert::InsertReport;
pub use levels::LevelError;
pub use limit::WhenFull;
pub use list::{DatumError, VoxelList};
pub use merge::MergeError;
pub use occupancy::OccupancyList;
pub use region::{Region, RegionError};
pub use store::VoxelStore;
pub use voxel::{OFFSET_UNIT_M, Voxel};

#[cfg(test)]
mod tests;
