//! Server messages.

use serde::Serialize;
use serde_json::json;

/// Advertised channel.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Advertised {
    /// Channel id.
    pub id: u32,
    /// Full name of the topic.
    pub topic: String,
    /// Always `cdr`.
    pub encoding: &'static str,
    /// Type, such as `tf2_msgs/msg/TFMessage`.
    pub schema_name: &'static str,
    /// Always `ros2msg`.
    pub schema_encoding: &'static str,
    /// Definition of the type with its dependencies.
    pub schema: String,
}

/// Advertised service.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct AdvertisedService {
    /// Service id.
    pub id: u32,
    /// Full name.
    pub name: String,
    /// Type, such as `std_srvs/srv/Empty`.
    #[serde(rename = "type")]
    pub type_name: &'static str,
    /// Definition of the request type with its dependencies.
    pub request_schema: String,
    /// Definition of the response type with its dependencies.
    pub response_schema: String,
}

/// First message. `session` differs after each start, so that clients restart. No ROS distribution is
/// named: viewers would use its message definitions instead of ours. `source`: `live` or `file`.
pub fn server_info(session: &str, capabilities: &[&str], source: &str) -> String {
    json!({
        "op": "serverInfo",
        "name": "lattice viewer_server",
        "capabilities": capabilities,
        "supportedEncodings": ["cdr"],
        "metadata": { "source": source },
        "sessionId": session,
    })
    .to_string()
}

/// Advertises channels.
pub fn advertise(channels: &[&Advertised]) -> String {
    json!({ "op": "advertise", "channels": channels }).to_string()
}

/// Warning shown to the user of the client.
pub fn status(message: &str) -> String {
    json!({ "op": "status", "level": 1, "message": message }).to_string()
}

/// Advertises services.
pub fn advertise_services(services: &[AdvertisedService]) -> String {
    json!({ "op": "advertiseServices", "services": services }).to_string()
}

/// Service response: operation 3, service, call, encoding, CDR.
pub fn service_response(service: u32, call: u32, cdr: &[u8]) -> Vec<u8> {
    let encoding = b"cdr";
    let mut bytes = vec![3];
    for number in [service, call, encoding.len() as u32] {
        bytes.extend_from_slice(&number.to_le_bytes());
    }
    bytes.extend_from_slice(encoding);
    bytes.extend_from_slice(cdr);
    bytes
}

/// Failed service call.
pub fn service_failure(service: u32, call: u32, message: &str) -> String {
    json!({ "op": "serviceCallFailure", "serviceId": service, "callId": call, "message": message })
        .to_string()
}

/// Topic or service names, each with node names.
type Linked<'a> = Vec<(&'a str, Vec<&'a str>)>;

/// Changes of the node graph.
pub struct GraphUpdate<'a> {
    /// Topics with changed publishers, each with all its publishers.
    pub published: Linked<'a>,
    /// Topics with changed subscribers, each with all its subscribers.
    pub subscribed: Linked<'a>,
    /// Services with changed servers, each with all its servers.
    pub services: Linked<'a>,
    /// Removed topics.
    pub removed_topics: Vec<&'a String>,
    /// Removed services.
    pub removed_services: Vec<&'a String>,
}

/// Graph update message.
pub fn connection_graph_update(update: &GraphUpdate<'_>) -> String {
    let list = |all: &Linked<'_>, ids: &str| -> Vec<serde_json::Value> {
        let entry = |(name, nodes): &(&str, Vec<&str>)| json!({ "name": name, ids: nodes });
        all.iter().map(entry).collect()
    };
    json!({
        "op": "connectionGraphUpdate",
        "publishedTopics": list(&update.published, "publisherIds"),
        "subscribedTopics": list(&update.subscribed, "subscriberIds"),
        "advertisedServices": list(&update.services, "providerIds"),
        "removedTopics": update.removed_topics,
        "removedServices": update.removed_services,
    })
    .to_string()
}

/// Parameter values message.
pub fn parameter_values(parameters: &[impl Serialize], id: Option<&str>) -> String {
    let mut message = json!({ "op": "parameterValues", "parameters": parameters });
    if let (Some(id), Some(fields)) = (id, message.as_object_mut()) {
        fields.insert("id".to_owned(), id.into());
    }
    message.to_string()
}

/// Message data: operation 1, subscription, time of arrival, CDR.
pub fn message_data(subscription: u32, stamp_ns: u64, cdr: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(13 + cdr.len());
    bytes.push(1);
    bytes.extend_from_slice(&subscription.to_le_bytes());
    bytes.extend_from_slice(&stamp_ns.to_le_bytes());
    bytes.extend_from_slice(cdr);
    bytes
}
