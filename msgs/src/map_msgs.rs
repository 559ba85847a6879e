//! Updates of occupancy grids.

use serde::{Deserialize, Serialize};

use crate::interface::messages;
use crate::std_msgs::Header;

messages! {
    "map_msgs" in "../definitions/map_msgs/";
    OccupancyGridUpdate [Header];
}

/// New values for a rectangle of a [`crate::nav_msgs::OccupancyGrid`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OccupancyGridUpdate {
    /// Frame of the grid.
    pub header: Header,
    /// First cell along x.
    pub x: i32,
    /// First cell along y.
    pub y: i32,
    /// Cells along x.
    pub width: u32,
    /// Cells along y.
    pub height: u32,
    /// Values as of the grid, row by row.
    pub data: Vec<i8>,
}
