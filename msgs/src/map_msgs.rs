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
    /// Column (x index) of the first cell.
    pub x: i32,
    /// Row (y index) of the first cell.
    pub y: i32,
    /// Number of columns (cells along x).
    pub width: u32,
    /// Number of rows (cells along y).
    pub height: u32,
    /// Occupancy values as in the grid, row by row.
    pub data: Vec<i8>,
}
