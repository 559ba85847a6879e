//! Nodes and runtime against ros2-client over RustDDS, another DDS and another client library.
#![allow(clippy::unwrap_used)]

mod action;
mod client;
mod services;
