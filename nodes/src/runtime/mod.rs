//! What rcl does and ros2-client does not.

pub mod names;
pub mod params;
pub mod params_file;
pub mod ros_args;
