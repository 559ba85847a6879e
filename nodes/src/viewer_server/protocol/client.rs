//! Client messages.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Limit of list entries per message.
const MAX_LIST: usize = 256;

/// Malformed client message. The client is notified and stays connected.
#[derive(Debug, Error)]
pub enum ProtocolError {
    /// Unknown message.
    #[error("invalid message: {0}")]
    Json(#[from] serde_json::Error),
    /// List above the limit.
    #[error("{found} entries in one message, more than {MAX_LIST}")]
    TooMany {
        /// Length of the list.
        found: usize,
    },
    /// Unknown binary message.
    #[error("a binary message is too short, or of an unknown kind")]
    Binary,
}

/// Text message of a client.
#[derive(Debug, Deserialize, PartialEq)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
pub enum ClientMessage {
    /// Subscribe to channels.
    Subscribe {
        /// Requested subscriptions.
        subscriptions: Vec<SubscriptionRequest>,
    },
    /// Unsubscribe.
    Unsubscribe {
        /// Ids of the subscriptions.
        subscription_ids: Vec<u32>,
    },
    /// Read parameters.
    GetParameters {
        /// Full names; empty: all.
        #[serde(default)]
        parameter_names: Vec<String>,
        /// Repeated in the reply.
        id: Option<String>,
    },
    /// Set parameters.
    SetParameters {
        /// Names and values.
        parameters: Vec<Value>,
        /// Repeated in the reply.
        id: Option<String>,
    },
    /// Watch parameters.
    SubscribeParameterUpdates {
        /// Full names; empty: all.
        #[serde(default)]
        parameter_names: Vec<String>,
    },
    /// Stop watching parameters.
    UnsubscribeParameterUpdates {
        /// Full names; empty: all.
        #[serde(default)]
        parameter_names: Vec<String>,
    },
    /// Advertise client channels.
    Advertise {
        /// The channels.
        channels: Vec<ClientChannel>,
    },
    /// Remove client channels.
    Unadvertise {
        /// Ids of the channels.
        channel_ids: Vec<u32>,
    },
    /// Follow the node graph.
    SubscribeConnectionGraph,
    /// Stop following it.
    UnsubscribeConnectionGraph,
    /// Another operation, which is not supported.
    #[serde(other)]
    Other,
}

/// Requested subscription.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(rename_all = "camelCase")]
pub struct SubscriptionRequest {
    /// Subscription id, chosen by the client.
    pub id: u32,
    /// Channel of the server.
    pub channel_id: u32,
}

/// Parameter value.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Value {
    /// Full name: node name, a dot, parameter name.
    pub name: String,
    /// JSON value.
    #[serde(default)]
    pub value: serde_json::Value,
    /// Type that JSON does not express, such as `float64`.
    #[serde(rename = "type", default, skip_serializing_if = "Option::is_none")]
    pub kind: Option<String>,
}

/// A channel of a client.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(rename_all = "camelCase")]
pub struct ClientChannel {
    /// Channel id, chosen by the client.
    pub id: u32,
    /// Full name of the topic.
    pub topic: String,
    /// Must be `cdr`.
    pub encoding: String,
    /// Type of the messages.
    pub schema_name: String,
}

/// Binary message of a client.
#[derive(Debug, PartialEq)]
pub enum ClientData<'a> {
    /// Message on a client channel.
    Message {
        /// The channel.
        channel: u32,
        /// The message.
        payload: &'a [u8],
    },
    /// Service call.
    Call {
        /// Service id.
        service: u32,
        /// Call id, chosen by the client.
        call: u32,
        /// Must be `cdr`.
        encoding: &'a [u8],
        /// The request.
        payload: &'a [u8],
    },
}

impl<'a> ClientData<'a> {
    /// Parses a binary message.
    pub fn parse(bytes: &'a [u8]) -> Result<Self, ProtocolError> {
        Self::read(bytes).ok_or(ProtocolError::Binary)
    }

    fn read(bytes: &'a [u8]) -> Option<Self> {
        let (kind, mut rest) = bytes.split_first()?;
        let mut number = || {
            let (number, after) = rest.split_first_chunk()?;
            rest = after;
            Some(u32::from_le_bytes(*number))
        };
        let first = number()?;
        if *kind == 1 {
            let (channel, payload) = (first, rest);
            return Some(Self::Message { channel, payload });
        }
        let (call, length) = (number()?, number()?);
        let (encoding, payload) = rest.split_at_checked(length as usize)?;
        (*kind == 2).then_some(Self::Call {
            service: first,
            call,
            encoding,
            payload,
        })
    }
}

impl ClientMessage {
    /// Parses a text message.
    pub fn parse(text: &str) -> Result<Self, ProtocolError> {
        let message = serde_json::from_str(text)?;
        let found = match &message {
            Self::Subscribe { subscriptions } => subscriptions.len(),
            Self::Unsubscribe { subscription_ids } => subscription_ids.len(),
            Self::GetParameters {
                parameter_names, ..
            }
            | Self::SubscribeParameterUpdates { parameter_names }
            | Self::UnsubscribeParameterUpdates { parameter_names } => parameter_names.len(),
            Self::SetParameters { parameters, .. } => parameters.len(),
            Self::Advertise { channels } => channels.len(),
            Self::Unadvertise { channel_ids } => channel_ids.len(),
            Self::SubscribeConnectionGraph | Self::UnsubscribeConnectionGraph | Self::Other => 0,
        };
        match found > MAX_LIST {
            true => Err(ProtocolError::TooMany { found }),
            false => Ok(message),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SUBSCRIBE: &str =
        r#"{"op":"subscribe","subscriptions":[{"id":7,"channelId":2},{"id":8,"channelId":3}]}"#;

    #[test]
    fn messages_are_read() {
        let wishes =
            [(7, 2), (8, 3)].map(|(id, channel_id)| SubscriptionRequest { id, channel_id });
        let subscriptions = wishes.to_vec();
        let message = ClientMessage::parse(SUBSCRIBE).unwrap();
        assert_eq!(message, ClientMessage::Subscribe { subscriptions });
        let message = ClientMessage::parse(r#"{"op":"unsubscribe","subscriptionIds":[7]}"#);
        let subscription_ids = vec![7];
        assert_eq!(
            message.unwrap(),
            ClientMessage::Unsubscribe { subscription_ids }
        );
        let message = ClientMessage::parse(r#"{"op":"fetchAsset","uri":"x","requestId":1}"#);
        assert_eq!(message.unwrap(), ClientMessage::Other);
        let message = ClientMessage::parse(r#"{"op":"subscribeConnectionGraph"}"#);
        assert_eq!(message.unwrap(), ClientMessage::SubscribeConnectionGraph);
        for wrong in [
            "",
            "[]",
            "{}",
            r#"{"op":"advertise","channels":[{"id":1}]}"#,
            r#"{"op":"subscribe"}"#,
            r#"{"op":"subscribe","subscriptions":[{"id":-1,"channelId":0}]}"#,
        ] {
            assert!(ClientMessage::parse(wrong).is_err(), "{wrong}");
        }
        let many = vec!["1"; MAX_LIST + 1].join(",");
        let many = format!(r#"{{"op":"unsubscribe","subscriptionIds":[{many}]}}"#);
        assert!(matches!(
            ClientMessage::parse(&many),
            Err(ProtocolError::TooMany { found: 257 })
        ));
    }

    #[test]
    fn binary_messages_are_read_as_far_as_they_go() {
        let call = [
            &[2, 7, 0, 0, 0, 9, 0, 0, 0, 3, 0, 0, 0][..],
            b"cdr",
            &[0, 1],
        ]
        .concat();
        let expected = ClientData::Call {
            service: 7,
            call: 9,
            encoding: b"cdr",
            payload: &[0, 1],
        };
        assert_eq!(ClientData::parse(&call).unwrap(), expected);
        for length in 0..16 {
            assert!(ClientData::parse(&call[..length]).is_err(), "{length}");
        }
        let mut huge = call.clone();
        huge[9..13].fill(255);
        assert!(ClientData::parse(&huge).is_err());
        assert!(ClientData::parse(&[&[3], &call[1..]].concat()).is_err());
        let message = ClientData::parse(&[1, 4, 0, 0, 0, 8]).unwrap();
        let (channel, payload) = (4, &[8][..]);
        assert_eq!(message, ClientData::Message { channel, payload });
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(5000))]
        #[test]
        fn mutated_messages_do_not_panic(changes in prop::collection::vec((0..SUBSCRIBE.len(), any::<u8>()), 1..6)) {
            let mut bytes = SUBSCRIBE.as_bytes().to_vec();
            for (at, byte) in changes {
                bytes[at] = byte;
            }
            let _ = ClientMessage::parse(&String::from_utf8_lossy(&bytes));
        }
    }
}
