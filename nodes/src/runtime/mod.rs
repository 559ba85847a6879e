//! What rcl does and ros2-client does not.

pub mod env;
pub mod logging;
pub mod names;
pub mod params;
pub mod params_file;
pub mod qos;
pub mod ros_args;
