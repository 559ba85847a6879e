//! The Lattice ROS 2 nodes: state machines without I/O, and the runtime that moves their messages.
#![forbid(unsafe_code)]

pub mod bag;
pub mod bag_player;
pub mod bench;
pub mod cli;
pub mod compute;
pub mod convert;
pub mod enu_transformer;
pub mod evaluate;
pub mod files;
pub mod lattice_mapper;
pub mod map_follower;
pub mod node;
pub mod paper;
mod plot;
pub mod replay;
pub mod report;
pub mod runtime;
pub mod semantic_icp_server;
pub mod simulate;
pub mod voxel_marker_publisher;
