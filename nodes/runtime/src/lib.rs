//! ROS 2 client library: arguments, names, parameters, topics, services, actions, time and logging, over
//! an abstract transport.
//!
//! | to | begin with |
//! |---|---|
//! | start a process and its nodes | [`ros_args::RosArgs::parse`], [`Runtime::start`], [`Runtime::node`] |
//! | publish | [`Node::publisher`] |
//! | subscribe | [`Node::subscribe`] |
//! | serve and call a service | [`Node::service`], [`Node::client`] |
//! | serve an action | [`Node::action_server`] |
//! | read parameters | [`Node::params`] |
//! | run code in periods | [`Runtime::timer`] |
//! | manage states | [`lifecycle`] |
//! | report to `/diagnostics` | [`Node::diagnostics`] |
//! | be apart from all else on the machine, as in tests | [`LoopbackDomain`] |
//!
//! Programs are in `examples/`: `1_publish_and_subscribe`, `2_service`, `3_action`. Messages are those of
//! [`lattice_msgs`].
#![deny(unsafe_code)]

/// Compiles the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod action;
mod arrivals;
mod clock;
#[expect(unsafe_code, reason = "borrows sockets of the transport")]
mod confine;
#[expect(unsafe_code, reason = "calls the C API of Cyclone DDS")]
mod cyclone;
mod diagnostics;
mod discovered_graph;
mod endpoints;
pub mod env;
mod error;
mod gaps;
mod graph;
pub mod lifecycle;
mod lifecycle_gate;
mod local_bus;
mod logger_services;
pub mod logging;
mod loopback_domain;
mod names;
mod node;
mod outbox;
mod output_types;
mod param_services;
mod param_value;
pub mod params;
pub mod params_file;
mod peers;
mod port;
mod process;
mod publisher;
pub mod qos;
mod remote;
#[cfg(feature = "zenoh")]
mod rmw_zenoh;
pub mod ros_args;
mod rosout;
pub mod security;
mod service;
mod shared;
mod shutdown;
mod subscription;
mod sync;
mod task_thread;
mod tf;
mod tf_guard;
mod timer;
mod type_description;
mod type_versions;

pub use action::{ActionLimits, ActionServer, Feedback, GoalHandle};
pub use clock::Clock;
pub use diagnostics::{Diagnostics, Level, WORKING};
pub use discovered_graph::{GraphEndpoint, RemoteEndpoint};
pub use error::{PublishError, RuntimeError};
pub use loopback_domain::LoopbackDomain;
pub use names::renamed_topic;
pub use node::Node;
pub use process::Runtime;
pub use publisher::{Publisher, RawPublisher};
pub use remote::{Announced, GraphRole, RemotePublisher};
pub use service::{Reply, Server};
pub use shared::{CallError, Client};
pub use shutdown::{Shutdown, catch_file_size_signal};
pub use subscription::{Losses, Subscription, SubscriptionExecutor, Undecoded};
pub use sync::lock;
pub use task_thread::run_catching_panics;
pub use tf::{StaticTfBroadcaster, TfBroadcaster};
pub use tf_guard::TfGuard;
pub use timer::Timer;
