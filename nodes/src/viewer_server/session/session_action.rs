//! Actions for messages of a client.

use super::inputs::Input;
use crate::viewer_server::protocol::{SubscriptionRequest, Value};

/// Request that the bridge executes.
#[derive(Debug, PartialEq)]
pub enum BridgeRequest {
    /// Service call.
    Call {
        /// Service id.
        service: u32,
        /// Call id of the client.
        call: u32,
        /// CDR.
        request: Vec<u8>,
    },
    /// Read parameters.
    GetParameters(Vec<String>, Option<String>),
    /// Set parameters.
    SetParameters(Vec<Value>, Option<String>),
    /// Publish a message on an offered topic, by its index.
    Publish(usize, Vec<u8>),
}

/// Action for a client message.
#[derive(Debug, PartialEq)]
pub enum SessionAction {
    /// Subscribe to channels.
    Subscribe(Vec<SubscriptionRequest>),
    /// Unsubscribe.
    Unsubscribe(Vec<u32>),
    /// Start or stop watching these parameters; none: all.
    Watch(Vec<String>, bool),
    /// Start or stop following the node graph.
    Graph(bool),
    /// Pass a request to the bridge.
    Request(BridgeRequest),
    /// Publish a message on a headset topic, without a reply.
    Input(Input),
    /// Send a text to the client.
    Reply(String),
    /// No action.
    Done,
}
