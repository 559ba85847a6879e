//! The supported part of the Foxglove WebSocket protocol, version 1.

mod client;
mod server;

pub use client::{ClientChannel, ClientData, ClientMessage, SubscriptionRequest, Value};
pub use server::{
    Advertised, AdvertisedService, GraphUpdate, advertise, advertise_services,
    connection_graph_update, message_data, parameter_values, server_info, service_failure,
    service_response, status,
};

/// Subprotocol names, the preferred one first; they are equivalent for the supported part.
pub const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
