//! What labels mean.

use serde::{Deserialize, Serialize};

use crate::interface::messages;
use crate::std_msgs::Header;

messages! {
    "vision_msgs" in "../definitions/vision_msgs/";
    VisionClass [];
    LabelInfo [Header, VisionClass];
}

/// A class that a segmenter tells apart.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct VisionClass {
    /// Its number.
    pub class_id: u16,
    /// Its name.
    pub class_name: String,
}

/// What the class numbers of a segmenter mean. The largest number (65535, or 255 in uint8) is no
/// class.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LabelInfo {
    /// Since when, and of which sensor.
    pub header: Header,
    /// The classes.
    pub class_map: Vec<VisionClass>,
    /// Least confidence of a label, 0 to 1.
    pub threshold: f32,
}
