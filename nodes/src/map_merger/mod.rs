//! Merging of maps of several robots.
//!
//! Each voxel is the integer sum over the robots' maps, so the order of
//! messages does not matter. The input of each robot is its `voxel_map`: counts, mean offsets
//! in the unit of the message, and the most frequent label.

mod machine;
pub mod node;
mod options;
mod parameters;
mod robot_map;

pub use machine::{MapMerger, MergerCounts};
pub use options::{MergedLabels, MergerOptions};
pub use parameters::declare;
pub use robot_map::{Refusal, RobotMap};
