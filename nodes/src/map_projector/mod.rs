//! `map_projector`: occupancy grids of a followed map for Nav2, and paths on its ground.
//!
//! [`MapProjector`] is a state machine without I/O; [`node`] connects it to DDS.

mod changes;
mod diagnosis;
mod machine;
mod messages;
pub mod node;
mod options;
mod parameters;
mod plan;
mod plan_counts;
mod planner;
mod robot;
mod window;

pub use machine::{MapProjector, Projected, ProjectorCounts, ProjectorReport};
pub use messages::{grid_message, percent};
pub use options::MapProjectorOptions;
pub use parameters::declare;
pub use plan_counts::PlanCounts;
