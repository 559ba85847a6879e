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
//! | use messages of your own | [`include_messages!`] and the crate `lattice_msgs_generator` |
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

pub mod cdr;
pub mod rmw_dds_common;

mod action;
mod interface;
mod livox;
mod registry;
mod time;
mod type_hash;

/// Modules of the packages whose messages `lattice_msgs_generator` made in the build script of the crate.
///
/// ```text
/// lattice_msgs::include_messages! {
///     /// Messages of my robot.
///     my_msgs,
/// }
/// ```
#[macro_export]
macro_rules! include_messages {
    ($($(#[$attribute:meta])* $package:ident),* $(,)?) => {
        $($(#[$attribute])*
        #[allow(clippy::all, clippy::pedantic)]
        pub mod $package {
            include!(concat!(env!("OUT_DIR"), "/", stringify!($package), ".rs"));
        })*
    };
}

/// Modules of packages, and a visitor of all their messages.
macro_rules! packages {
    ($($(#[$attribute:meta])* $package:ident,)*) => {
        include_messages! { $($(#[$attribute])* $package),* }

        fn visit_packages(visitor: &mut impl MessageVisitor) {
            $($package::visit_messages(visitor);)*
        }
    };
}

packages! {
    /// Messages common to all actions: goals, their states, their cancellation.
    action_msgs,
    /// Time and duration.
    builtin_interfaces,
    /// States of nodes.
    diagnostic_msgs,
    /// Geographic positions and poses.
    geographic_msgs,
    /// Positions, rotations, poses, velocities and transforms.
    geometry_msgs,
    /// Messages of Lattice (package `lattice_msgs`): maps, and the calibration of a headset.
    lattice,
    /// States of managed nodes and their transitions.
    lifecycle_msgs,
    /// Messages of livox_interfaces.
    livox_interfaces,
    /// Messages of livox_ros_driver.
    livox_ros_driver,
    /// Messages of livox_ros_driver2.
    livox_ros_driver2,
    /// Updates of occupancy grids.
    map_msgs,
    /// Odometry, paths and occupancy grids.
    nav_msgs,
    /// Inertial solution of the NovAtel OEM7 driver (ROS 2 branches).
    novatel_oem7_msgs,
    /// Octrees of octomap_server, and its calls.
    octomap_msgs,
    /// Log and parameters of nodes.
    rcl_interfaces,
    /// Services of rosbag2's player and recorder.
    rosbag2_interfaces,
    /// Simulated time.
    rosgraph_msgs,
    /// Point clouds, laser scans, images, inertial and satellite measurements.
    sensor_msgs,
    /// Header, colour and plain values.
    std_msgs,
    /// Calls of common use.
    std_srvs,
    /// The frame tree.
    tf2_msgs,
    /// Descriptions of types.
    type_description_interfaces,
    /// Identifiers.
    unique_identifier_msgs,
    /// Meaning of labels.
    vision_msgs,
    /// Markers, in the layout of Humble and later.
    visualization_msgs,
}

/// Names that generated code uses.
#[doc(hidden)]
pub mod generated {
    pub use serde;
    pub use serde_big_array::BigArray;
    pub use serde_bytes::ByteBuf;
}

pub use action::RosAction;
pub use interface::{RosMessage, RosService, Schema, dds_type_name};
pub use registry::{
    MessageVisitor, definition_of, hash_of, know_message, know_service, schema_of, visit_messages,
};
pub use type_hash::{type_description, type_hash};
