//! The occupied voxel list: which cells of a lattice hold points, how many, and where in the cell.
//!
//! Everything that is summed is an integer, so that neither the order of the points nor the number
//! of threads can change a bit, and lists merge exactly.

pub mod codec;
pub mod file;
pub mod set_ops;

mod changes;
mod decay;
mod distortion;
mod exposed;
mod insert;
mod limit;
mod list;
mod merge;
mod occupancy;
mod region;
mod retain;
mod store;
mod voxel;
mod voxel_store;

pub use changes::Changes;
pub use decay::NoStamps;
pub use distortion::Distortion;
pub use insert::InsertReport;
pub use limit::WhenFull;
pub use list::{DatumError, VoxelList};
pub use merge::MergeError;
pub use occupancy::OccupancyList;
pub use region::{Region, RegionError};
pub use store::payload_columns::{LabelCount, Payload, Stamps};
pub use voxel::{OFFSET_UNIT_M, Voxel};
pub use voxel_store::VoxelStore;

#[cfg(test)]
mod tests;
