//! Occupied voxel lists: which cells of a lattice contain points, how many, and where in the cell.
//!
//! All sums are integers, so that neither the order of the points nor the number of threads changes a bit, and lists
//! merge exactly.

pub mod codec;
#[cfg(feature = "file")]
pub mod file;
#[cfg(feature = "file")]
pub mod label_names;
pub mod set_ops;

mod distortion;
mod list;
mod occupancy;
mod region;
pub(crate) mod store;
mod voxel;
mod voxel_store;

pub use distortion::{Distortion, DistortionSums};
pub use list::{Changes, DatumError, InsertReport, NoStamps, PointColumns, VoxelList, WhenFull};
pub use occupancy::OccupancyList;
pub use region::{Region, RegionError};
pub use store::color_sum::ColorSum;
pub use store::payload_columns::{LabelCount, Payload, Stamps};
pub use voxel::{OFFSET_UNIT_M, Voxel};
pub use voxel_store::VoxelStore;
