//! Settings of a process and its nodes: names, arguments, parameters, environment, security.

pub mod env;
pub(crate) mod names;
pub(crate) mod param_value;
pub mod params;
pub mod params_file;
pub mod ros_args;
pub mod security;
