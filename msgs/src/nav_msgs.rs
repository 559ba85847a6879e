//! Odometry and paths.

use serde::{Deserialize, Serialize};

use crate::geometry_msgs::{PoseStamped, PoseWithCovariance, TwistWithCovariance};
use crate::interface::messages;
use crate::std_msgs::Header;

messages! {
    "nav_msgs" in "../definitions/nav_msgs/";
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
