//! Odometry, paths and occupancy grids.

use serde::{Deserialize, Serialize};

use crate::builtin_interfaces::Time;
use crate::geometry_msgs::{Pose, PoseStamped, PoseWithCovariance, TwistWithCovariance};
use crate::interface::messages;
use crate::std_msgs::Header;

messages! {
    "nav_msgs" in "../definitions/nav_msgs/";
    MapMetaData [Time, Pose];
    OccupancyGrid [Header, MapMetaData];
    Odometry [Header, PoseWithCovariance, TwistWithCovariance];
    Path [Header, PoseStamped];
}

/// Estimate of pose and velocity.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Odometry {
    /// Time, and frame of the pose.
    pub header: Header,
    /// Moving frame; the twist is given in it.
    pub child_frame_id: String,
    /// Header.frame_id from child_frame_id.
    pub pose: PoseWithCovariance,
    /// Velocity of the moving frame, in that frame.
    pub twist: TwistWithCovariance,
}

/// Poses in order of time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Path {
    /// Time of the last pose, and frame of all.
    pub header: Header,
    /// The poses.
    pub poses: Vec<PoseStamped>,
}

/// Place and size of the cells of a grid.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MapMetaData {
    /// Time at which the map was made.
    pub map_load_time: Time,
    /// Edge of a cell, m.
    pub resolution: f32,
    /// Cells along x.
    pub width: u32,
    /// Cells along y.
    pub height: u32,
    /// Corner of cell (0, 0) in the frame of the map.
    pub origin: Pose,
}

/// Probabilities of occupancy on a grid of cells.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OccupancyGrid {
    /// Frame of the map.
    pub header: Header,
    /// Place and size of the cells.
    pub info: MapMetaData,
    /// Row by row from the origin, x fastest: 0 to 100 percent, -1 unknown.
    pub data: Vec<i8>,
}
