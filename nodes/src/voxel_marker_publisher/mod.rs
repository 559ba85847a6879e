//! `voxel_marker_publisher`: markers of exposed cell faces in blocks, updated incrementally.
//!
//! [`VoxelMarkers`] is a state machine without I/O; [`node`] connects it to DDS.

mod blocks;
mod color;
mod machine;
pub mod node;
mod options;
mod packer;
mod parameters;
mod shape;

pub use machine::{MarkerCounts, MarkerReport, VoxelMarkers};
pub use options::{ColorBy, MarkerOptions, MarkerStyle};
pub use parameters::declare;
