//! The Lattice ROS 2 nodes: state machines without I/O, and the runtime that moves their messages.
#![forbid(unsafe_code)]

pub mod bag;
pub mod convert;
pub mod files;
pub mod runtime;
pub mod simulate;
