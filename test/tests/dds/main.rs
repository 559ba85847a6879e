//! Nodes and runtime over real DDS, against foreign peers.
#![allow(clippy::unwrap_used)]

mod actions;
mod calibration;
mod conformance;
mod cyclone;
mod elevation;
mod forged_maps;
mod fresh_clients;
mod ground_plan;
mod headset;
mod losses;
mod machines;
mod map_driver;
mod markers;
mod network;
mod octomap;
mod odometry;
mod params;
mod projected_map;
mod rclpy;
mod rgbd;
mod scans;
mod second_parent;
mod security;
#[cfg(feature = "onnx")]
mod segmenter;
mod transport;
