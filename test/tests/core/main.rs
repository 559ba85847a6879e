//! The library against independent arithmetic, brute force and its own invariants.

mod calibration;
mod calibration_misread;
mod calibration_regions;
mod calibration_symmetry;
mod cloud;
#[path = "../../fuzz/src/lib.rs"]
mod fuzz;
mod fuzz_seeds;
mod geodesy;
mod lattice_basis;
mod lattice_properties;
mod map_file;
mod pose;
mod query;
mod raycast;
mod registration_pair;
mod voxel_colors;
mod voxels_operations;
mod voxels_properties;
