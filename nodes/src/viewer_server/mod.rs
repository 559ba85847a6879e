//! `viewer_server`: a web page with the map, and a Foxglove WebSocket, on one port, with or without TLS.
//!
//! The node's thread follows the map and passes messages to a [`Broadcaster`]; the server's thread sends them to each
//! client at the client's rate.

mod access;
mod bridge;
mod broadcast;
mod fixed;
mod host_addresses;
mod http;
mod map_source;
pub mod node;
mod options;
mod parameters;
mod protocol;
mod server;
mod session;
mod sources;
mod tls;

pub use access::Access;
pub use broadcast::{
    Bridge, Broadcaster, BroadcasterCounts, Class, ConnectionGraph, Cursor, Demand, Entry,
    MapStream, Next, Outbox, Outgoing,
};
pub use fixed::{serve, serve_labelled};
pub use http::{Decision, Head, RequestAuth};
pub use map_source::{MapChange, MapSource};
pub use options::ViewerOptions;
pub use parameters::declare;
pub use protocol::{AdvertisedService, ClientChannel, SUBPROTOCOLS, SubscriptionRequest, Value};
pub use server::Server;
pub use session::{
    BridgeRequest, ClientSession, Input, InputCounts, InputRefusal, Inputs, Offer, OpenTopic,
    SessionAction,
};
pub use tls::{Identity, Tls, TlsError};

#[cfg(test)]
mod hostile_tests;
#[cfg(test)]
mod pause_tests;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod tls_tests;
