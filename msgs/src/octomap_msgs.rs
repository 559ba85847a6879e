//! Octrees of octomap_server, and its calls.

use serde::{Deserialize, Serialize};

use crate::geometry_msgs::Point;
use crate::interface::{messages, services};
use crate::std_msgs::Header;

messages! {
    "octomap_msgs" in "../definitions/octomap_msgs/";
    Octomap [Header];
}

services! {
    "octomap_msgs" in "../definitions/octomap_msgs/";
    BoundingBoxQuery: BoundingBoxQueryRequest [Point], BoundingBoxQueryResponse [];
    GetOctomap: GetOctomapRequest [], GetOctomapResponse [Octomap];
}

/// An octree of OctoMap without the header of its file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Octomap {
    /// Stamp, and frame of the tree.
    pub header: Header,
    /// True for free, occupied and unknown only; false for log-odds.
    pub binary: bool,
    /// Class of the tree, such as `OcTree`.
    pub id: String,
    /// Edge of the smallest voxels, m.
    pub resolution: f64,
    /// Nodes, depth first.
    pub data: Vec<i8>,
}

/// Requests an octree.
#[derive(Clone, Copy, Debug)]
pub struct GetOctomap;

/// Request of [`GetOctomap`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GetOctomapRequest {
    /// Padding: a structure on the wire has at least one byte.
    pub structure_needs_at_least_one_member: u8,
}

/// Response of [`GetOctomap`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GetOctomapResponse {
    /// The tree.
    pub map: Octomap,
}

/// Clears a box along the axes of the map.
#[derive(Clone, Copy, Debug)]
pub struct BoundingBoxQuery;

/// Request of [`BoundingBoxQuery`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BoundingBoxQueryRequest {
    /// Lower corner, m.
    pub min: Point,
    /// Upper corner, m.
    pub max: Point,
}

/// Response of [`BoundingBoxQuery`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BoundingBoxQueryResponse {
    /// Padding: a structure on the wire has at least one byte.
    pub structure_needs_at_least_one_member: u8,
}
