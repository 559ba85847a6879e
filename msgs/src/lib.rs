//! ROS 2 messages as serde structs.
//!
//! One module per ROS package, with the names of ROS; a field named `type` is `type_` here.
//! The layout is that of Jazzy; of `nav2_msgs` that of Kilted.
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

mod action;
pub mod cdr;
mod interface;
mod livox;
mod packages;
mod registry;
pub mod rmw_dds_common;
mod time;
mod type_hash;

/// Names that generated code uses.
#[doc(hidden)]
pub mod generated {
    pub use serde;
    pub use serde_big_array::BigArray;
    pub use serde_bytes::ByteBuf;
}

pub use action::RosAction;
pub use interface::{MessageVisitor, RosMessage, RosService, Schema, dds_type_name};
pub use packages::*;
pub use registry::{definition_of, hash_of, know_message, know_service, schema_of, visit_messages};
pub use type_hash::{type_description, type_hash};
