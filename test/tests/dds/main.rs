//! Nodes and runtime over real DDS, against foreign peers.
#![allow(clippy::unwrap_used)]

mod action_peer;
mod calibration;
mod cyclone;
mod ros2_client_peer;
mod ros_args_grammar;
mod transport;
