//! Messages of the server.

use serde::Serialize;
use serde_json::json;

/// A channel as clients see it.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Advertised {
    /// By which clients subscribe.
    pub id: u32,
    /// Full name of the topic.
    pub topic: String,
    /// Always `cdr`.
    pub encoding: &'static str,
    /// Type, such as `tf2_msgs/msg/TFMessage`.
    pub schema_name: &'static str,
    /// Always `ros2msg`.
    pub schema_encoding: &'static str,
    /// Text of the type with all that it holds.
    pub schema: String,
}

/// The first message. `session` is another one after each start, so that clients begin anew. No
/// distribution of ROS is named: viewers would take its definitions for ours.
pub fn server_info(session: &str) -> String {
    json!({
        "op": "serverInfo",
        "name": "lattice viewer_server",
        "capabilities": [],
        "supportedEncodings": ["cdr"],
        "metadata": {},
        "sessionId": session,
    })
    .to_string()
}

/// The channels that there are.
pub fn advertise(channels: &[&Advertised]) -> String {
    json!({ "op": "advertise", "channels": channels }).to_string()
}

/// A warning for the person at the client.
pub fn status(message: &str) -> String {
    json!({ "op": "status", "level": 1, "message": message }).to_string()
}

/// A message of a channel: operation 1, subscription, time of arrival, CDR.
pub fn message_data(subscription: u32, stamp_ns: u64, cdr: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(13 + cdr.len());
    bytes.push(1);
    bytes.extend_from_slice(&subscription.to_le_bytes());
    bytes.extend_from_slice(&stamp_ns.to_le_bytes());
    bytes.extend_from_slice(cdr);
    bytes
}
