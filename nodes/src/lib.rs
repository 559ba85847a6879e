//! The Lattice ROS 2 nodes: state machines without I/O, and the ROS nodes around them.
#![forbid(unsafe_code)]

#[cfg(feature = "bags")]
pub mod bag_player;
#[cfg(feature = "bags")]
pub mod bag_recorder;
pub mod camera;
pub mod cloud_input;
pub mod compute;
pub mod convert;
pub mod enu_transformer;
pub mod executables;
pub mod files;
#[cfg(feature = "headset")]
pub mod headset_cloud;
pub mod hurry;
pub mod lattice_mapper;
pub mod lidar_odometry;
pub mod map_follower;
mod map_input;
pub mod map_merger;
mod map_output;
pub mod map_projector;
#[cfg(feature = "headset")]
pub mod mesh;
pub mod octree;
mod options;
#[cfg(feature = "bags")]
pub mod replay;
pub mod report;
pub mod running;
pub mod segmenter;
pub mod semantic_cloud;
pub mod semantic_icp_server;
mod stamps;
pub mod start;
#[cfg(feature = "viewer")]
pub mod viewer_server;
pub mod voxel_marker_publisher;
