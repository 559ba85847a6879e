//! Nodes and runtime over real DDS, against foreign peers.
#![allow(clippy::unwrap_used)]

mod action_peer;
mod calibration;
mod client;
mod conformance;
mod cyclone;
mod headset;
mod losses;
mod params;
mod peer;
mod rclpy;
mod rgbd;
mod ros2_client_peer;
mod security;
#[cfg(feature = "onnx")]
mod segmenter;
mod transport;
