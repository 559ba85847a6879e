//! Capabilities offered to clients.

use crate::viewer_server::protocol::AdvertisedService;

/// Largest client message on topics without their own limit, bytes.
pub const MAX_MESSAGE_BYTES: usize = 64 << 10;
/// Header before a message: operation and channel.
pub const MESSAGE_HEAD_BYTES: usize = 5;

/// A topic that clients may publish on.
#[derive(Clone, Debug)]
pub struct OpenTopic {
    /// Full name.
    pub name: String,
    /// Type of its messages.
    pub type_name: &'static str,
    /// Limit of bytes per message of a headset topic, which sends no replies; `None`: each message has a reply.
    pub stream_bytes: Option<usize>,
}

/// Capabilities offered to clients, besides channels.
#[derive(Clone, Debug, Default)]
pub struct Offer {
    /// Services, by their ids.
    pub services: Vec<AdvertisedService>,
    /// Topics.
    pub topics: Vec<OpenTopic>,
    /// True if parameters are accessible.
    pub parameters: bool,
    /// True if the node graph is available.
    pub graph: bool,
    /// Rate limit per client on headset topics, bytes per second.
    pub stream_bytes_per_s: usize,
}

impl Offer {
    /// Capability names of the protocol.
    pub fn capabilities(&self) -> Vec<&'static str> {
        [
            ("services", !self.services.is_empty()),
            ("parameters", self.parameters),
            ("parametersSubscribe", self.parameters),
            ("clientPublish", !self.topics.is_empty()),
            ("connectionGraph", self.graph),
        ]
        .into_iter()
        .filter_map(|(name, offered)| offered.then_some(name))
        .collect()
    }

    /// Largest client message, bytes.
    pub fn max_message_bytes(&self) -> usize {
        let streams = self.topics.iter().filter_map(|topic| topic.stream_bytes);
        let longest = streams.map(|bytes| bytes.saturating_add(MESSAGE_HEAD_BYTES));
        longest.fold(MAX_MESSAGE_BYTES, usize::max)
    }
}
