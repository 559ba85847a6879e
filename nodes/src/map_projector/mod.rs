//! `map_projector`: occupancy grids of a followed map for Nav2, its ground for legged robots, and paths on it.
//!
//! [`MapProjector`] is a state machine without I/O; [`node`] connects it to DDS.

mod changes;
mod counts;
mod diagnosis;
mod inputs;
mod machine;
mod messages;
pub mod node;
mod options;
mod outputs;
mod parameters;
mod plan;
mod plan_counts;
mod planner;
mod robot;
mod window;

pub use counts::{ProjectorCounts, ProjectorReport};
pub use machine::{MapProjector, Projected};
pub use messages::{elevation_message, grid_message, percent};
pub use options::MapProjectorOptions;
pub use parameters::declare;
pub use plan_counts::PlanCounts;
