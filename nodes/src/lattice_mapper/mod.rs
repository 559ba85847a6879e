//! `lattice_mapper`: quantizes clouds of the map frame into an occupied voxel list on a lattice.
//!
//! [`LatticeMapper`] is a state machine without I/O; [`node`] connects it to DDS.

mod autosave;
mod call;
mod compute_state;
mod corrected;
mod counts;
mod datum;
mod free_options;
mod free_space;
mod initial_map;
mod machine;
mod map_folder;
mod map_messages;
pub mod node;
mod occupancy;
mod octomap;
mod octree;
mod operations;
mod options;
mod outputs;
mod parameters;
mod plan;
mod refusal;
mod report;
mod services;
mod state;
mod status;
mod unmapped;

pub use corrected::{CorrectedDrive, CorrectionCounts};
pub use counts::MapperCounts;
pub use free_options::{FreeSpaceMethod, MappedFreeSpace};
pub use operations::LoadRefusal;
pub use options::{MapPayload, MapperOptions, cube_m3};
pub use parameters::declare;
pub use refusal::CloudRefusal;
pub use report::MapperReport;
pub use state::LatticeMapper;
