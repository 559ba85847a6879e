//! Pure library without ROS, sockets or clocks.
#![deny(unsafe_code)]

pub mod cloud;
pub mod geodesy;
mod kd_tree;
pub mod lattice;
pub mod odometry;
pub mod pose;
mod prefetch;
pub mod query;
pub mod raycast;
pub mod registration;
pub mod voxels;
