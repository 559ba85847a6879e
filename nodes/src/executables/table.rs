//! Table of nodes.

#[cfg(feature = "headset")]
use crate::headset_cloud;
use crate::start::{Declare, Start};
#[cfg(feature = "viewer")]
use crate::viewer_server;
use crate::{
    enu_transformer, lattice_mapper, lidar_odometry, map_merger, map_projector, segmenter,
    semantic_cloud, semantic_icp_server, voxel_marker_publisher,
};

/// Nodes that can share a process, in the order of the data flow.
pub const NODES: &[(&str, Start)] = &[
    ("segmenter", segmenter::node::start),
    ("semantic_cloud", semantic_cloud::node::start),
    #[cfg(feature = "headset")]
    ("headset_cloud", headset_cloud::node::start),
    ("lidar_odometry", lidar_odometry::node::start),
    ("enu_transformer", enu_transformer::node::start),
    ("lattice_mapper", lattice_mapper::node::start),
    ("map_merger", map_merger::node::start),
    ("map_projector", map_projector::node::start),
    (
        "voxel_marker_publisher",
        voxel_marker_publisher::node::start,
    ),
    ("semantic_icp_server", semantic_icp_server::node::start),
    #[cfg(feature = "viewer")]
    ("viewer_server", viewer_server::node::start),
];

/// Readers of the parameters of those nodes.
pub const PARAMETERS: &[(&str, Declare)] = &[
    ("segmenter", segmenter::declare),
    ("semantic_cloud", semantic_cloud::declare),
    #[cfg(feature = "headset")]
    ("headset_cloud", headset_cloud::declare),
    ("lidar_odometry", lidar_odometry::declare),
    ("enu_transformer", enu_transformer::declare),
    ("lattice_mapper", lattice_mapper::declare),
    ("map_merger", map_merger::declare),
    ("map_projector", map_projector::declare),
    ("voxel_marker_publisher", voxel_marker_publisher::declare),
    ("semantic_icp_server", semantic_icp_server::declare),
    #[cfg(feature = "viewer")]
    ("viewer_server", viewer_server::declare),
];

/// Finds the node of an executable name.
pub fn find(name: &str) -> Option<Start> {
    let found = NODES.iter().find(|(node, _)| *node == name);
    found.map(|(_, start)| *start)
}

/// Finds the reader of the parameters of an executable.
pub fn reader_of(name: &str) -> Option<Declare> {
    let found = PARAMETERS.iter().find(|(node, _)| *node == name);
    found.map(|(_, declare)| *declare)
}
