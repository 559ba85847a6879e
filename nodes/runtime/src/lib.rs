//! What rcl does and ros2-client does not: arguments, names, parameters, and the transport.
#![forbid(unsafe_code)]

mod action;
mod clock;
mod core;
mod dds;
mod diagnostics;
pub mod env;
mod error;
mod graph;
mod local_bus;
pub mod logging;
mod loopback_domain;
pub mod names;
mod node;
mod param_services;
pub mod params;
pub mod params_file;
mod peers;
mod publisher;
pub mod qos;
mod reader_port;
pub mod ros_args;
mod rosout;
mod runtime;
mod service;
mod service_wire;
mod shutdown;
mod subscription;
mod sync;
mod tf;
mod transport_status;
mod worker;

pub use action::{ActionLimits, ActionServer, Feedback, GoalHandle};
pub use clock::Clock;
pub use diagnostics::{Diagnostics, Level};
pub use error::{PublishError, RuntimeError};
pub use loopback_domain::LoopbackDomain;
pub use node::Node;
pub use publisher::{Publisher, RawPublisher};
pub use runtime::Runtime;
pub use service::{Reply, Server};
pub use shutdown::Shutdown;
pub use subscription::{Load, Subscription, Undecoded};
pub use tf::{StaticTfBroadcaster, TfBroadcaster};
pub use worker::guarded;
