//! ROS 2 messages as serde structs.
//!
//! One module per ROS package, with the names of ROS; a field named `type` is `type_` here.
//! The layout is that of Jazzy.
//!
//! | to | begin with |
//! |---|---|
//! | build or read a message | its package, such as [`sensor_msgs`] or [`geometry_msgs`] |
//! | encode and decode it | [`cdr::to_vec`], [`cdr::from_slice`] |
//! | know its type name and schema text | [`RosMessage`], [`definition_of`] |
//! | know its type hash (RIHS01) | [`hash_of`]; [`type_hash`] of any definition |
//! | define a message of your own | [`RosMessage`], [`RosService`], [`RosAction`] |
//!
//! ```
//! use lattice_msgs::builtin_interfaces::Time;
//! use lattice_msgs::cdr;
//!
//! let bytes = cdr::to_vec(&Time { sec: 1, nanosec: 2 })?;
//! assert_eq!(bytes, [0, 1, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0]);
//! assert_eq!(cdr::from_slice::<Time>(&bytes)?.to_ns(), 1_000_000_002);
//! # Ok::<(), cdr::CdrError>(())
//! ```
#![forbid(unsafe_code)]

/// Runs the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

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
mod livox;
pub mod map_msgs;
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
pub use livox::{livox_interfaces, livox_ros_driver, livox_ros_driver2};
pub use registry::{MessageVisitor, definition_of, visit_messages};
pub use type_hash::{hash_of, schema_of, type_description, type_hash};
