//! Meaning of labels.

use serde::{Deserialize, Serialize};

use crate::interface::messages;
use crate::std_msgs::Header;

messages! {
    "vision_msgs" in "../definitions/vision_msgs/";
    VisionClass [];
    LabelInfo [Header, VisionClass];
}

/// A class of a segmenter.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct VisionClass {
    /// Number of the class.
    pub class_id: u16,
    /// Name of the class.
    pub class_name: String,
}

/// Meaning of a segmenter's class numbers. The largest number (65535, or 255 in uint8) is no
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
