//! Headset messages from clients: counters and reasons for rejection.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use lattice_runtime::lock;
use serde::Serialize;

/// Undecoded client message on a headset topic.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// Index of the topic in the offer.
    pub topic: usize,
    /// True for JSON, false for CDR.
    pub is_json: bool,
    /// The message.
    pub bytes: Vec<u8>,
}

/// Reason for rejecting a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InputRefusal {
    /// Message size above the limit.
    TooLong,
    /// Rate of the client above the limit.
    TooMuch,
    /// The node's inbox is full.
    Busy,
    /// Not a message of the topic's type.
    Malformed,
    /// Mesh chunk above the size limit, or a mesh of too many chunks.
    LongChunk,
    /// Mesh names too long to be repeated in each chunk.
    LongNames,
    /// The publisher's queue is full.
    NotSent,
}

impl InputRefusal {
    /// Counter name.
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

    /// Text for the client.
    pub fn words(self) -> &'static str {
        match self {
            Self::TooLong => "the message is longer than `headset_message_bytes`",
            Self::TooMuch => "this client exceeds `headset_bytes_per_s`",
            Self::Busy => "the node's inbox is full",
            Self::Malformed => "not a message of the type of its topic",
            Self::LongChunk => {
                "a chunk of a mesh has more than 60 kB, or a whole one more than 1000 of them: send it in more surfaces"
            }
            Self::LongNames => "session, surface and frame of a mesh have more than 2 kB",
            Self::NotSent => "the publisher's queue is full",
        }
    }
}

/// Counters of headset messages, with rejections by reason.
#[derive(Clone, Debug, Default, Serialize)]
pub struct InputCounts {
    /// Messages published.
    pub headset_in: u64,
    /// Bytes of these messages.
    pub headset_bytes_in: u64,
    /// Messages rejected, by reason.
    pub headset_refused: BTreeMap<&'static str, u64>,
}

/// Client messages in the node's inbox: limited to half of its events and bytes, so that clients cannot displace the map.
#[derive(Debug)]
pub struct Waiting {
    max_events: usize,
    max_bytes: usize,
    events: AtomicUsize,
    bytes: AtomicUsize,
}

impl Waiting {
    /// Limits for an inbox of `events` and `bytes`.
    pub fn new(events: usize, bytes: usize) -> Self {
        Self {
            max_events: (events / 2).max(1),
            max_bytes: bytes / 2,
            events: AtomicUsize::new(0),
            bytes: AtomicUsize::new(0),
        }
    }

    /// Counts a queued message; false if the limit is reached.
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

    /// Counts a message that left the queue.
    pub fn leave(&self, bytes: usize) {
        self.events.fetch_sub(1, Ordering::Relaxed);
        self.bytes.fetch_sub(bytes, Ordering::Relaxed);
    }
}

/// Shared counters.
#[derive(Debug, Default)]
pub struct Inputs(Mutex<InputCounts>);

impl Inputs {
    /// Counts a published message.
    pub fn taken(&self, bytes: usize) {
        let mut counts = lock(&self.0);
        counts.headset_in += 1;
        counts.headset_bytes_in += bytes as u64;
    }

    /// Counts a rejected message.
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
