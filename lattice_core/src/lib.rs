//! Occupied voxel maps on lattices, and algorithms on them, without ROS, sockets or clocks.
//!
//! | to | begin with |
//! |---|---|
//! | find the cell of a point | [`lattice::Lattice`] |
//! | map clouds | [`voxels::VoxelList`]; [`voxels::OccupancyList`] with a bit for each cell |
//! | find nearest voxels, clearances and paths | [`query::Query`] |
//! | drive on the ground | [`navigation::Projector`] |
//! | know free space, or clear what moved | [`raycast::FreeSpaceMap`], [`raycast::RayClearer`] |
//! | read point records of any layout | [`cloud::CloudLayout`] |
//! | interpolate poses and frames | [`pose::PoseBuffer`], [`pose::TransformBuffer`] |
//! | convert WGS84 and ENU | [`geodesy::EnuFrame`] |
//! | read and write map files | [`voxels::file`] (feature `file`) |
//! | register clouds | [`registration::register`] (feature `registration`) |
//! | find a cloud in a map without a guess | [`registration::register_global`] (feature `registration`) |
//! | follow a lidar by its scans | [`odometry::Odometry`] (feature `registration`) |
//! | correct its poses where it comes back to a place | [`loop_closure::LoopCloser`] (feature `registration`) |
//!
//! Both features are defaults. Programs are in `examples/`, from `1_quantize_a_scan` to `4_odometry_of_scans`. Vectors
//! and poses are those of [`nalgebra`], which is re-exported.
#![deny(unsafe_code)]
// Some functions are for the files or for the registration alone.
#![cfg_attr(not(all(feature = "file", feature = "registration")), allow(dead_code))]

/// Runs the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

pub use nalgebra;

pub mod cloud;
pub mod geodesy;
mod kd_tree;
pub mod lattice;
#[cfg(feature = "registration")]
pub mod loop_closure;
pub mod navigation;
#[cfg(feature = "registration")]
pub mod odometry;
pub mod pose;
mod prefetch;
pub mod query;
pub mod raycast;
#[cfg(feature = "registration")]
pub mod registration;
pub mod voxels;
