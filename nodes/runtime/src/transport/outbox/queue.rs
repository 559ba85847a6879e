//! Queue and state of a writer.

use std::sync::atomic::Ordering::{Relaxed, Release};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use futures::future::{Either, select};
use lattice_msgs::cdr::CdrError;
use smol::Timer;
use smol::channel::Sender;

use super::budget::Budget;
use crate::logging::Throttle;
use crate::sync::lock;
use crate::transport::port::{
    Bytes, ENCAPSULATION_BYTES, EndpointId, SampleId, SampleWriter, WriteRefusal,
};

/// Longest wait of a sample for a full send window before it is dropped.
pub(super) const PATIENCE: Duration = Duration::from_secs(1);

/// Longest wait after a sample was dropped: a stalled peer must not slow down the others.
pub(super) const PATIENCE_WITH_STUCK_PEER: Duration = Duration::from_millis(20);

/// Period of warnings about dropped messages.
pub(super) const WARNING_PERIOD: Duration = Duration::from_secs(5);

/// Policy for a full send window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WhenFull {
    /// Drop and count the sample after a short wait.
    Drop,
    /// Wait without a limit.
    Wait,
}

/// Serializes a sample, encapsulation header included, on the publisher thread.
pub(crate) type Serialize = Box<dyn FnOnce() -> Result<Vec<u8>, CdrError> + Send>;

pub(super) enum Job {
    Sample {
        content: Content,
        reserved: usize,
        related: Option<SampleId>,
    },
    /// Replied to when everything before it has been passed to DDS.
    Flush(Sender<()>),
}

pub(super) enum Content {
    Body(Bytes),
    Later(Serialize),
}

/// Queue of one writer, as seen by its caller.
pub(crate) struct Outbox {
    pub(super) id: EndpointId,
    pub(super) jobs: Sender<Job>,
    pub(super) shared: Arc<Shared>,
}

/// State shared by both ends.
pub(super) struct Shared {
    pub(super) topic: String,
    // Removed at shutdown, when handles of the publisher may still exist.
    pub(super) writer: Mutex<Option<Arc<dyn SampleWriter>>>,
    pub(super) budget: Budget,
    pub(super) when_full: WhenFull,
    pub(super) last_bytes: AtomicUsize,
    /// Samples in the queue, including the one being written.
    pub(super) waiting: AtomicUsize,
    pub(super) dropped: AtomicU64,
    pub(super) sent: AtomicU64,
    pub(super) sent_bytes: AtomicU64,
    pub(super) stuck: AtomicBool,
    pub(super) warning: Throttle,
}

impl Shared {
    pub(super) fn writer(&self) -> Option<Arc<dyn SampleWriter>> {
        lock(&self.writer).clone()
    }

    /// Removes a sample, sent or not, from the accounting.
    pub(super) fn done(&self, reserved: usize) {
        self.waiting.fetch_sub(1, Release);
        self.budget.give_back(reserved);
    }

    pub(super) fn drop_one(&self, why: &str) {
        let dropped = self.dropped.fetch_add(1, Relaxed).saturating_add(1);
        if self.warning.check().is_some() {
            log::warn!("{}: message dropped ({dropped} so far): {why}", self.topic);
        }
    }

    fn count_sent(&self, body: &Bytes) {
        self.sent.fetch_add(1, Relaxed);
        self.sent_bytes.fetch_add(body.len() as u64, Relaxed);
    }

    pub(super) fn body(&self, content: Content) -> Option<Bytes> {
        match content {
            Content::Body(body) => Some(body),
            Content::Later(serialize) => match serialize() {
                Ok(bytes) => {
                    self.last_bytes.store(bytes.len(), Relaxed);
                    let mut body = Bytes::from(bytes);
                    Some(body.split_off(ENCAPSULATION_BYTES.min(body.len())))
                }
                Err(error) => {
                    self.drop_one(&error.to_string());
                    None
                }
            },
        }
    }

    pub(super) async fn write(&self, body: Bytes, related: Option<SampleId>) {
        let start = Instant::now();
        while let Some(writer) = self.writer() {
            let may_wait = self.when_full == WhenFull::Wait;
            let left = match self.when_full {
                WhenFull::Wait => WARNING_PERIOD,
                WhenFull::Drop if self.stuck.load(Relaxed) => {
                    PATIENCE_WITH_STUCK_PEER.saturating_sub(start.elapsed())
                }
                WhenFull::Drop => PATIENCE.saturating_sub(start.elapsed()),
            };
            let write = writer.write(body.clone(), related);
            let result = match select(write, Timer::after(left)).await {
                Either::Left((result, _)) => result,
                Either::Right(_) if may_wait => {
                    let topic = &self.topic;
                    log::warn!(
                        "{topic}: waiting for a reliable subscriber that does not acknowledge"
                    );
                    continue;
                }
                Either::Right(_) => {
                    self.stuck.store(true, Relaxed);
                    return match writer.is_sending(&body) {
                        true => self.count_sent(&body),
                        false => self.drop_one("a reliable subscriber does not keep up"),
                    };
                }
            };
            match result {
                Ok(_) => {
                    self.stuck.store(false, Relaxed);
                    return self.count_sent(&body);
                }
                // The transport's timeout is shorter; our own patience decides.
                Err(WriteRefusal::Full) => {}
                Err(WriteRefusal::Failed(why)) => return self.drop_one(&why),
            }
        }
    }
}
