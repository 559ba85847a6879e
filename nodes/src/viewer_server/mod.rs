//! `viewer_server`: a web page with the map, and a Foxglove WebSocket, on one port.
//!
//! The node's thread follows the map and passes messages to a [`Broadcaster`]; the server's thread sends them to each
//! client at the client's rate.

mod bridge;
mod broadcaster;
mod client;
mod client_session;
mod connection;
mod connection_limit;
mod counts;
mod fixed;
mod graph;
mod http;
mod inputs;
mod map_source;
mod map_stream;
pub mod node;
mod offer;
mod options;
mod outbox;
mod parameters;
mod protocol;
mod rate_limit;
mod server;
mod sources;
mod stream;
mod thin;
mod watched;

pub use bridge::Bridge;
pub use broadcaster::{Broadcaster, Demand};
pub use client_session::{BridgeRequest, ClientSession, SessionAction};
pub use counts::BroadcasterCounts;
pub use fixed::{serve, serve_labelled};
pub use graph::ConnectionGraph;
pub use http::{Decision, Head, RequestAuth};
pub use inputs::{Input, InputCounts, InputRefusal, Inputs};
pub use map_source::{MapChange, MapSource};
pub use map_stream::{Cursor, Entry, MapStream, Next};
pub use offer::{Offer, OpenTopic};
pub use options::{ViewerOptions, url};
pub use outbox::{Class, Outbox, Outgoing};
pub use parameters::declare;
pub use protocol::{AdvertisedService, ClientChannel, SUBPROTOCOLS, SubscriptionRequest, Value};
pub use server::Server;

#[cfg(test)]
mod hostile_tests;
#[cfg(test)]
mod pause_tests;
#[cfg(test)]
mod tests;
