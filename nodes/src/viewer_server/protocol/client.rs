//! Messages of a client.

use serde::Deserialize;
use thiserror::Error;

/// Most subscriptions that one message may name.
const MAX_LIST: usize = 256;

/// Error of a message of a client. It is told so, and stays connected.
#[derive(Debug, Error)]
pub enum ProtocolError {
    /// No message of the protocol.
    #[error("not understood: {0}")]
    Json(#[from] serde_json::Error),
    /// A longer list than anybody needs.
    #[error("{found} subscriptions in one message, at most {MAX_LIST} are taken")]
    TooMany {
        /// Length of the list.
        found: usize,
    },
    /// Binary messages are for writing, which is not offered.
    #[error("binary messages are not taken here: this server only shows")]
    Binary,
}

/// A message of a client.
#[derive(Debug, Deserialize, PartialEq)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
pub enum ClientMessage {
    /// Wants messages of channels.
    Subscribe {
        /// The wishes.
        subscriptions: Vec<Wish>,
    },
    /// Wants them no more.
    Unsubscribe {
        /// Ids of the subscriptions.
        subscription_ids: Vec<u32>,
    },
    /// Anything else, which is not offered.
    #[serde(other)]
    Other,
}

/// A subscription that a client wants.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(rename_all = "camelCase")]
pub struct Wish {
    /// By which the client knows the messages.
    pub id: u32,
    /// Channel of the server.
    pub channel_id: u32,
}

impl ClientMessage {
    /// Reads a text message.
    pub fn parse(text: &str) -> Result<Self, ProtocolError> {
        let message = serde_json::from_str(text)?;
        let found = match &message {
            Self::Subscribe { subscriptions } => subscriptions.len(),
            Self::Unsubscribe { subscription_ids } => subscription_ids.len(),
            Self::Other => 0,
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
        let wishes = [(7, 2), (8, 3)].map(|(id, channel_id)| Wish { id, channel_id });
        let subscriptions = wishes.to_vec();
        let message = ClientMessage::parse(SUBSCRIBE).unwrap();
        assert_eq!(message, ClientMessage::Subscribe { subscriptions });
        let message = ClientMessage::parse(r#"{"op":"unsubscribe","subscriptionIds":[7]}"#);
        let subscription_ids = vec![7];
        assert_eq!(
            message.unwrap(),
            ClientMessage::Unsubscribe { subscription_ids }
        );
        let message = ClientMessage::parse(r#"{"op":"advertise","channels":[{"id":1}]}"#);
        assert_eq!(message.unwrap(), ClientMessage::Other);
        for wrong in [
            "",
            "[]",
            "{}",
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
