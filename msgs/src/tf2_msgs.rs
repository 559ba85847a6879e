//! The frame tree.

use serde::{Deserialize, Serialize};

use crate::geometry_msgs::TransformStamped;
use crate::interface::messages;

messages! {
    "tf2_msgs" in "../definitions/tf2_msgs/";
    TFMessage [TransformStamped];
}

/// Some edges of the frame tree.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TFMessage {
    /// The edges.
    pub transforms: Vec<TransformStamped>,
}
