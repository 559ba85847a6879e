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
//! | run code in periods | [`Runtime::timer`], [`Runtime::resting_timer`] |
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

mod activity;
mod communication;
mod config;
mod error;
mod graph;
pub mod logging;
mod node;
mod shutdown;
mod sync;
mod task_thread;
mod transport;

pub use activity::Activity;
pub use communication::action::{ActionLimits, ActionServer, Feedback, GoalHandle};
pub use communication::publisher::{Publisher, RawPublisher};
pub use communication::service::{Reply, Server};
pub use communication::subscription::{Losses, Subscription, SubscriptionExecutor, Undecoded};
pub use config::names::renamed_topic;
pub use config::{env, params, params_file, ros_args, security};
pub use error::{PublishError, RuntimeError};
pub use graph::discovered_graph::{GraphEndpoint, RemoteEndpoint};
pub use node::clock::Clock;
pub use node::diagnostics::{Diagnostics, Level, WORKING};
pub use node::lifecycle;
pub use node::logical_node::Node;
pub use node::process::Runtime;
pub use node::shared::{CallError, Client};
pub use node::tf::{StaticTfBroadcaster, TfBroadcaster};
pub use node::tf_guard::TfGuard;
pub use node::timer::Timer;
pub use shutdown::{Shutdown, catch_file_size_signal};
pub use sync::lock;
pub use task_thread::run_catching_panics;
pub use transport::loopback_domain::LoopbackDomain;
pub use transport::qos;
pub use transport::remote::{Announced, GraphRole, RemotePublisher};
