//! All that clients may ask for.

use super::protocol::AdvertisedService;

/// Longest message of a client but on topics that take longer ones, bytes.
pub const MAX_MESSAGE_BYTES: usize = 64 << 10;
/// Operation and channel before a message.
pub const MESSAGE_HEAD_BYTES: usize = 5;

/// A topic that clients may publish on.
#[derive(Clone, Debug)]
pub struct OpenTopic {
    /// Full name.
    pub name: String,
    /// Type of its messages.
    pub type_name: &'static str,
    /// Longest message of a topic of a headset, whose messages come without end and are not answered; `None`:
    /// each message is a question.
    pub stream_bytes: Option<usize>,
}

/// All that clients may ask for besides what is shown.
#[derive(Clone, Debug, Default)]
pub struct Offer {
    /// Services, by their ids.
    pub services: Vec<AdvertisedService>,
    /// Topics.
    pub topics: Vec<OpenTopic>,
    /// True if parameters may be read and set.
    pub parameters: bool,
    /// True if the graph of nodes is known.
    pub graph: bool,
    /// Bytes that a client may send on the topics of a headset each second.
    pub stream_bytes_per_s: usize,
}

impl Offer {
    /// Names of what is offered in the protocol.
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

    /// Longest message that may come from a client.
    pub fn max_message_bytes(&self) -> usize {
        let streams = self.topics.iter().filter_map(|topic| topic.stream_bytes);
        let longest = streams.map(|bytes| bytes.saturating_add(MESSAGE_HEAD_BYTES));
        longest.fold(MAX_MESSAGE_BYTES, usize::max)
    }
}
