//! The state machines of the nodes, without I/O.

mod cloud_input;
mod counters;
mod elevation;
mod enu_transformer;
mod free_space;
mod headset_cloud;
mod lattice_mapper;
mod lattice_mapper_services;
mod lidar_odometry;
mod map_colors;
mod map_follower;
mod map_labels;
mod map_merger;
mod map_projector;
#[cfg(feature = "onnx")]
mod segmenter;
mod semantic_cloud;
mod semantic_clouds;
mod semantic_icp_server;
mod viewer_node;
mod voxel_marker_node;
mod voxel_markers;
