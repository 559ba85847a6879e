//! Between messages and the core, without logic.

pub mod cloud;
pub mod geometry;
pub mod map;
