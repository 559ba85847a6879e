//! ROS 2 messages as serde structs.
//!
//! One module per ROS package, with the names of ROS; a field named `type` is `type_` here.
//! The layout is that of Jazzy. [`RosMessage`] provides each message's type name and schema text,
//! [`cdr`] encodes and decodes messages. [`hash_of`] is the type hash
//! (RIHS01) of a message of this crate, [`type_hash`] that of any definition.
#![forbid(unsafe_code)]

pub mod action;
pub mod action_msgs;
pub mod builtin_interfaces;
pub mod calibration;
pub mod cdr;
pub mod diagnostic_msgs;
pub mod geographic_msgs;
pub mod geometry_msgs;
pub mod headset;
mod interface;
pub mod lattice;
pub mod lifecycle_msgs;
pub mod nav_msgs;
pub mod novatel_oem7_msgs;
pub mod octomap_msgs;
pub mod rcl_interfaces;
mod registry;
pub mod rmw_dds_common;
pub mod rosbag2_interfaces;
pub mod rosgraph_msgs;
pub mod sensor_msgs;
pub mod std_msgs;
pub mod std_srvs;
pub mod tf2_msgs;
mod time;
pub mod type_description_interfaces;
mod type_hash;
pub mod unique_identifier_msgs;
pub mod vision_msgs;
pub mod visualization_msgs;

pub use action::RosAction;
pub use interface::{RosMessage, RosService, Schema, dds_type_name};
pub use registry::{MessageVisitor, definition_of, visit_messages};
pub use type_hash::{hash_of, schema_of, type_description, type_hash};
