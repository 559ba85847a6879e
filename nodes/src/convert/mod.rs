//! Conversion between messages and the core, without logic.

pub mod calibration;
pub mod cloud;
pub mod corrections;
pub mod geometry;
pub mod headset_mesh;
pub mod map;
pub mod point_colors;
pub mod semantic;
pub mod viewpoint;
