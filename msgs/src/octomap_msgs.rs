//! The call of octomap_server that clears a box.

use serde::{Deserialize, Serialize};

use crate::geometry_msgs::Point;
use crate::interface::services;

services! {
    "octomap_msgs" in "../definitions/octomap_msgs/";
    BoundingBoxQuery: BoundingBoxQueryRequest [Point], BoundingBoxQueryResponse [];
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
