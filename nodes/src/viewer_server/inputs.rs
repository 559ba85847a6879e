//! Messages that clients publish for a headset: counted, and refused by name.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

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
    /// A part of a mesh that is too long to be sent on, or a mesh of too many parts.
    LongChunk,
    /// Names of a mesh that are too long to be in each of its parts.
    LongNames,
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
            Self::LongNames => "headset_long_names",
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
                "a chunk of a mesh has more than 60 kB, or a whole one more than 1000 of them: send it in more surfaces"
            }
            Self::LongNames => "session, surface and frame of a mesh have more than 2 kB",
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

/// Messages of clients in the node's inbox: at most half of its places and bytes, so that no client takes the map's.
#[derive(Debug)]
pub struct Waiting {
    max_events: usize,
    max_bytes: usize,
    events: AtomicUsize,
    bytes: AtomicUsize,
}

impl Waiting {
    /// Of an inbox of so many events and bytes.
    pub fn new(events: usize, bytes: usize) -> Self {
        Self {
            max_events: (events / 2).max(1),
            max_bytes: bytes / 2,
            events: AtomicUsize::new(0),
            bytes: AtomicUsize::new(0),
        }
    }

    /// Counts a message that is to wait; false if there is no room for it.
    pub fn enter(&self, bytes: usize) -> bool {
        let add = |to: &AtomicUsize, more: usize, most: usize| {
            let fits = |now: usize| now.checked_add(more).filter(|sum| *sum <= most);
            let order = Ordering::Relaxed;
            to.fetch_update(order, order, fits).is_ok()
        };
        if !add(&self.events, 1, self.max_events) {
            return false;
        }
        let has_room = add(&self.bytes, bytes, self.max_bytes);
        if !has_room {
            self.events.fetch_sub(1, Ordering::Relaxed);
        }
        has_room
    }

    /// Takes a message off that waits no more.
    pub fn leave(&self, bytes: usize) {
        self.events.fetch_sub(1, Ordering::Relaxed);
        self.bytes.fetch_sub(bytes, Ordering::Relaxed);
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_counted_by_reason_as_diagnostics_show_them() {
        use InputRefusal::*;
        let inputs = Inputs::default();
        inputs.taken(70);
        let reasons = [
            (TooLong, "headset_too_long"),
            (TooMuch, "headset_too_much"),
            (Busy, "headset_busy"),
            (Malformed, "headset_malformed"),
            (LongChunk, "headset_long_chunk"),
            (LongNames, "headset_long_names"),
            (NotSent, "headset_not_sent"),
        ];
        let mut expected = BTreeMap::from([("headset_in", 1), ("headset_bytes_in", 70)]);
        for (number, (refusal, name)) in (1..).zip(reasons) {
            (0..number).for_each(|_| inputs.refused(refusal));
            expected.insert(name, number);
        }
        let shown = crate::report::key_values(&inputs.counts()).into_iter();
        let expected = expected.into_iter();
        let expected: BTreeMap<_, _> = expected
            .map(|(key, count)| (key.to_owned(), count.to_string()))
            .collect();
        assert_eq!(shown.collect::<BTreeMap<_, _>>(), expected);
    }

    #[test]
    fn inputs_wait_in_half_of_the_inbox() {
        let waiting = Waiting::new(8, 1000);
        assert!(waiting.enter(500) && !waiting.enter(1));
        waiting.leave(500);
        assert_eq!((0..8).filter(|_| waiting.enter(10)).count(), 4);
        waiting.leave(10);
        // What found no room has taken none.
        assert!(!waiting.enter(471) && waiting.enter(470));
    }
}
