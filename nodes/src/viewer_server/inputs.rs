//! Messages that clients publish for a headset: counted, and refused by name.

use std::collections::BTreeMap;
use std::sync::Mutex;

use lattice_runtime::lock;
use serde::Serialize;

/// A message of a client on a topic of a headset, not yet read.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// Place of the topic in the offer.
    pub topic: usize,
    /// True for JSON, false for CDR.
    pub is_json: bool,
    /// The message.
    pub bytes: Vec<u8>,
}

/// Reason for which a message is not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InputRefusal {
    /// Longer than messages of headsets may be.
    TooLong,
    /// More bytes in a second than a client may send.
    TooMuch,
    /// The node has not worked off what came before.
    Busy,
    /// Not a message of the topic's type.
    Malformed,
    /// A part of a mesh that is too long to be sent on.
    LongChunk,
    /// Nobody took it from the publisher.
    NotSent,
}

impl InputRefusal {
    /// Name under which it is counted.
    pub fn name(self) -> &'static str {
        match self {
            Self::TooLong => "headset_too_long",
            Self::TooMuch => "headset_too_much",
            Self::Busy => "headset_busy",
            Self::Malformed => "headset_malformed",
            Self::LongChunk => "headset_long_chunk",
            Self::NotSent => "headset_not_sent",
        }
    }

    /// Word for the client.
    pub fn words(self) -> &'static str {
        match self {
            Self::TooLong => "the message is longer than `headset_message_bytes`",
            Self::TooMuch => "more than `headset_bytes_per_s` come from this client",
            Self::Busy => "the node has not worked off what came before",
            Self::Malformed => "not a message of the type of its topic",
            Self::LongChunk => {
                "a chunk of a mesh has more than 60 kB: send the surface whole, or in more"
            }
            Self::NotSent => "the publisher has no room",
        }
    }
}

/// Counters of messages for a headset, also by reason where they were refused.
#[derive(Clone, Debug, Default, Serialize)]
pub struct InputCounts {
    /// Messages that were published.
    pub headset_in: u64,
    /// Their bytes.
    pub headset_bytes_in: u64,
    /// Those that were not.
    pub headset_refused: BTreeMap<&'static str, u64>,
}

/// Shared counters.
#[derive(Debug, Default)]
pub struct Inputs(Mutex<InputCounts>);

impl Inputs {
    /// Counts a message that was published.
    pub fn taken(&self, bytes: usize) {
        let mut counts = lock(&self.0);
        counts.headset_in += 1;
        counts.headset_bytes_in += bytes as u64;
    }

    /// Counts a message that was not.
    pub fn refused(&self, refusal: InputRefusal) {
        *lock(&self.0)
            .headset_refused
            .entry(refusal.name())
            .or_default() += 1;
    }

    /// The counters.
    pub fn counts(&self) -> InputCounts {
        lock(&self.0).clone()
    }
}
