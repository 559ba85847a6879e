//! The transport over Zenoh, by the conventions of rmw_zenoh_cpp.
//!
//! A topic is a key expression, a service a queryable. Every node and endpoint declares a liveliness token, whose
//! key describes it; samples, requests and replies carry an attachment that names their sender.

mod attachment;
mod config;
mod graph;
mod keys;
mod publisher;
mod service;
mod session;
mod subscriber;

pub(crate) use session::Zenoh;
