//! The Foxglove WebSocket protocol, version 1, as far as a server that only shows needs it.

mod client;
mod server;

pub use client::{ClientMessage, ProtocolError};
pub use server::{Advertised, advertise, message_data, server_info, status};

/// Names of the protocol, the preferred one first: they differ in nothing that is used here.
pub const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
