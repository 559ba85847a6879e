//! The Foxglove WebSocket protocol, version 1, as far as it is needed here.

mod client;
mod server;

pub use client::{ClientChannel, ClientData, ClientMessage, Value, Wish};
pub use server::{
    Advertised, AdvertisedService, GraphUpdate, advertise, advertise_services,
    connection_graph_update, message_data, parameter_values, server_info, service_failure,
    service_response, status,
};

/// Names of the protocol, the preferred one first: they differ in nothing that is used here.
pub const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
