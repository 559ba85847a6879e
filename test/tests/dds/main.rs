//! Nodes and runtime over real DDS, against foreign peers.
#![allow(clippy::unwrap_used)]

mod calibration;
mod conformance;
mod cyclone;
mod headset;
mod losses;
mod octomap;
mod params;
mod rclpy;
mod rclpy_clients;
mod rgbd;
mod security;
#[cfg(feature = "onnx")]
mod segmenter;
mod transport;
