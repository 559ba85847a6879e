//! States of nodes.

use serde::{Deserialize, Serialize};

use crate::interface::messages;
use crate::std_msgs::Header;

messages! {
    "diagnostic_msgs" in "../definitions/diagnostic_msgs/";
    KeyValue [];
    DiagnosticStatus [KeyValue];
    DiagnosticArray [Header, DiagnosticStatus];
}

/// One value to show.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KeyValue {
    /// Label of the value.
    pub key: String,
    /// Value as text.
    pub value: String,
}

/// State of one task of a node.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DiagnosticStatus {
    /// One of the constants.
    pub level: u8,
    /// Node and task.
    pub name: String,
    /// The state in words.
    pub message: String,
    /// The device, if any.
    pub hardware_id: String,
    /// Figures.
    pub values: Vec<KeyValue>,
}

impl DiagnosticStatus {
    /// Normal operation.
    pub const OK: u8 = 0;
    /// Works, but needs attention.
    pub const WARN: u8 = 1;
    /// Does not work.
    pub const ERROR: u8 = 2;
    /// No recent status.
    pub const STALE: u8 = 3;
}

/// States of several tasks.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DiagnosticArray {
    /// Time of the states.
    pub header: Header,
    /// One for each task.
    pub status: Vec<DiagnosticStatus>,
}
