//! `map_projector`: occupancy grids of a followed map for Nav2.
//!
//! [`MapProjector`] is a state machine without I/O; [`node`] connects it to DDS.

mod changes;
mod machine;
mod messages;
pub mod node;
mod options;
mod parameters;
mod robot;
mod window;

pub use machine::{MapProjector, Projected, ProjectorCounts, ProjectorReport};
pub use messages::{grid_message, percent};
pub use options::MapProjectorOptions;
pub use parameters::declare;
