//! Header, colour and plain values.

use serde::{Deserialize, Serialize};

use crate::builtin_interfaces::Time;
use crate::interface::messages;

messages! {
    "std_msgs" in "../definitions/std_msgs/";
    Header [Time];
    String [];
    ColorRGBA [];
    Empty [];
    Bool [];
    Float64 [];
}

/// Time and frame of data.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Time of the data.
    pub stamp: Time,
    /// Frame of the data, without a leading slash.
    pub frame_id: std::string::String,
}

/// A text.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct String {
    /// UTF-8 text.
    pub data: std::string::String,
}

/// A colour; each part in [0, 1].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ColorRGBA {
    /// Red.
    pub r: f32,
    /// Green.
    pub g: f32,
    /// Blue.
    pub b: f32,
    /// Opacity, 1 = opaque.
    pub a: f32,
}

/// Nothing but its arrival.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Empty {
    /// Padding: a structure on the wire has at least one byte.
    pub structure_needs_at_least_one_member: u8,
}

/// A truth value.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Bool {
    /// The value.
    pub data: bool,
}

/// A number.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Float64 {
    /// The value.
    pub data: f64,
}
