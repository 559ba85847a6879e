//! Transport over Zenoh, by the conventions of rmw_zenoh_cpp.
//!
//! A topic is a key expression, a service a queryable. Every node and endpoint declares a liveliness token whose
//! key describes it. Samples, requests and replies carry an attachment with their sender.

mod attachment;
mod config;
mod error_text;
mod graph;
mod keys;
mod publisher;
mod service;
mod session;
mod subscriber;

pub(crate) use session::Zenoh;
