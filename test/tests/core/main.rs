//! The library against independent arithmetic, brute force and its own invariants.

mod cloud;
#[path = "../../fuzz/src/lib.rs"]
mod fuzz;
mod geodesy;
mod lattice_basis;
mod lattice_properties;
mod map_file;
mod map_file_fuzz;
mod pose;
mod query;
mod raycast_clear;
mod raycast_map;
mod raycast_traversal;
mod registration_pair;
mod voxels_operations;
mod voxels_properties;
