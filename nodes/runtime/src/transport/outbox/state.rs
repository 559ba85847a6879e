//! Counters of a queue and state of its writer.

use std::sync::Arc;
use std::sync::atomic::Ordering::{Acquire, Relaxed};
use std::time::Duration;

use super::Outbox;
use crate::transport::port::SampleWriter;

impl Outbox {
    /// Samples not sent: queue or send window full, or not serializable.
    pub(crate) fn dropped(&self) -> u64 {
        self.shared.dropped.load(Relaxed)
    }

    /// Samples passed to DDS.
    pub(crate) fn sent(&self) -> u64 {
        self.shared.sent.load(Relaxed)
    }

    /// Bytes passed to DDS, without encapsulation headers.
    pub(crate) fn sent_bytes(&self) -> u64 {
        self.shared.sent_bytes.load(Relaxed)
    }

    /// True if the transport keeps samples for late joiners even before a peer is matched.
    pub(crate) fn keeps_samples(&self) -> bool {
        let writer = self.shared.writer();
        writer.is_some_and(|writer| writer.keeps_samples())
    }

    /// True if the transport has a reader, also one that announces no endpoint.
    pub(crate) fn has_reader(&self) -> bool {
        let writer = self.shared.writer();
        writer.is_some_and(|writer| writer.has_reader())
    }

    /// Samples passed to DDS and not acknowledged by reliable readers, including readers that have left.
    pub(crate) fn unacknowledged(&self) -> u64 {
        let writer = self.shared.writer();
        writer.map_or(0, |writer| writer.unacknowledged())
    }

    /// True if the queue is empty and every reliable reader has acknowledged. Does not wait.
    pub(crate) fn is_acknowledged(&self) -> bool {
        let acknowledged =
            |writer: Arc<dyn SampleWriter>| writer.wait_for_acknowledgments(Duration::ZERO);
        self.shared.waiting.load(Acquire) == 0 && self.shared.writer().is_none_or(acknowledged)
    }
}
