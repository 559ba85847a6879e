//! ROS graph: nodes and endpoints of this process and of others.

pub(crate) mod discovered_graph;
pub(crate) mod endpoints;
pub(crate) mod local_graph;
pub(crate) mod output_types;
pub(crate) mod type_versions;
