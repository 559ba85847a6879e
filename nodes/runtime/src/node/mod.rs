//! Nodes and their process: endpoints, time, transforms, states, and the services of every node.

mod action_server;
pub(crate) mod clock;
pub(crate) mod diagnostics;
mod expected;
pub mod lifecycle;
mod logger_services;
pub(crate) mod logical_node;
mod node_services;
mod param_services;
pub(crate) mod process;
mod rosout;
pub(crate) mod shared;
pub(crate) mod tf;
pub(crate) mod tf_guard;
pub(crate) mod timer;
mod type_description;
