//! Odometry from the clouds of a lidar: `odom` -> `base_link` and how far it can be trusted.
//!
//! [`LidarOdometry`] is a state machine without I/O around [`lattice_core::odometry`].

mod counts;
mod live_loops;
mod loops;
mod machine;
mod motions;
pub mod node;
mod options;
mod parameters;
mod path;

pub use counts::{OdometryCounts, OdometryReport};
pub use loops::DriveLoops;
#[cfg(feature = "bags")]
pub(crate) use machine::PAUSE_NS;
pub use machine::{LidarOdometry, Registered, odometry_message};
pub use options::LidarOdometryOptions;
pub use parameters::declare;
