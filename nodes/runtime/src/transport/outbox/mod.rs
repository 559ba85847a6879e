//! Bounded queue of one writer, served by the publisher thread.
//!
//! Serialization, page faults and the wait for a full send window happen there, not in the caller;
//! a blocked writer delays its own queue only.

mod budget;
mod queue;
mod state;
#[cfg(test)]
mod tests;

use std::cell::Cell;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use smol::Timer;
use smol::channel::{Receiver, TrySendError, bounded};
use smol::future::{or, yield_now};

use self::budget::Budget;
use crate::error::PublishError;
use crate::logging::Throttle;
use crate::shutdown::Shutdown;
use crate::sync::lock;
use crate::transport::port::{Bytes, EndpointId, SampleId, SampleWriter};
use queue::{Content, Job, Shared, WARNING_PERIOD};
pub(crate) use queue::{Outbox, Serialize, WhenFull};

/// Consecutive samples of a queue before its task yields to others of the thread.
const JOBS_PER_TURN: u32 = 16;

impl Outbox {
    /// Creates the queue and the task for the publisher thread.
    pub(crate) fn new(
        topic: &str,
        writer: Arc<dyn SampleWriter>,
        when_full: WhenFull,
        queue_messages: usize,
        queue_bytes: usize,
    ) -> (Self, impl Future<Output = ()> + Send + 'static) {
        let id = writer.id();
        let (jobs, queue) = bounded(queue_messages.max(1));
        let shared = Arc::new(Shared {
            topic: topic.to_owned(),
            writer: Mutex::new(Some(writer)),
            budget: Budget::new(queue_bytes),
            when_full,
            last_bytes: AtomicUsize::new(0),
            waiting: AtomicUsize::new(0),
            dropped: AtomicU64::new(0),
            sent: AtomicU64::new(0),
            sent_bytes: AtomicU64::new(0),
            stuck: AtomicBool::new(false),
            warning: Throttle::new(WARNING_PERIOD),
        });
        let task = serve(Arc::clone(&shared), queue);
        (Self { id, jobs, shared }, task)
    }

    /// GUID of the writer.
    pub(crate) fn id(&self) -> EndpointId {
        self.id
    }

    /// Resolved topic or service, for messages.
    pub(crate) fn topic(&self) -> &str {
        &self.shared.topic
    }

    /// Queues a sample for later serialization. Its size is assumed to be that of the one before.
    pub(crate) fn send(&self, serialize: Serialize) -> Result<(), PublishError> {
        let bytes = self.shared.last_bytes.load(Relaxed);
        self.try_queue(Content::Later(serialize), bytes, None)
    }

    /// Queues the serialized body of a sample.
    pub(crate) fn send_body(
        &self,
        body: Bytes,
        related: Option<SampleId>,
    ) -> Result<(), PublishError> {
        let bytes = body.len();
        self.try_queue(Content::Body(body), bytes, related)
    }

    /// Queues the serialized body of a sample; waits up to `patience` while the queue is full, or until a shutdown
    /// request. Not from the runtime's threads.
    pub(crate) fn send_body_within(
        &self,
        body: Bytes,
        patience: Duration,
        shutdown: &Shutdown,
    ) -> Result<(), PublishError> {
        let reserved = body.len();
        let taken = Cell::new(false);
        let queued = async {
            if !self.shared.budget.take(reserved).await {
                return Err(self.closed());
            }
            taken.set(true);
            let job = Job::Sample {
                content: Content::Body(body),
                reserved,
                related: None,
            };
            self.shared.waiting.fetch_add(1, Relaxed);
            self.jobs.send(job).await.map_err(|_| self.closed())
        };
        let ended = async {
            shutdown.requested().await;
            Err(self.closed())
        };
        let too_long = async {
            Timer::after(patience).await;
            Err(self.full())
        };
        let outcome = smol::block_on(or(queued, or(ended, too_long)));
        if outcome.is_err() && taken.get() {
            self.shared.done(reserved);
        }
        outcome
    }

    /// Waits until a sample of `bytes` fits into the queue. False: timeout.
    pub(crate) fn has_room_within(&self, bytes: usize, patience: Duration) -> bool {
        let room = async {
            let budget = &self.shared.budget;
            budget.room(bytes, || !self.jobs.is_full()).await;
            true
        };
        let late = async {
            Timer::after(patience).await;
            false
        };
        smol::block_on(or(room, late))
    }

    /// Waits until the queue is empty and every reliable reader has acknowledged. False: timeout.
    pub(crate) fn flush(&self, timeout: Duration) -> bool {
        let start = Instant::now();
        let in_time = smol::block_on(smol::future::or(self.flushed(), async {
            Timer::after(timeout).await;
            None
        }));
        let left = timeout.saturating_sub(start.elapsed());
        let acknowledged = |writer: Arc<dyn SampleWriter>| writer.wait_for_acknowledgments(left);
        in_time.is_some() && self.shared.writer().is_some_and(acknowledged)
    }

    /// Completes when everything queued before has been passed to DDS; `None`: closed meanwhile.
    pub(crate) async fn flushed(&self) -> Option<()> {
        let (done, answer) = bounded(1);
        self.jobs.send(Job::Flush(done)).await.ok()?;
        answer.recv().await.ok()
    }

    /// Rejects further samples and leaves the topic.
    pub(crate) fn close(&self) {
        self.shared.budget.close();
        self.jobs.close();
        let writer = lock(&self.shared.writer).take();
        drop(writer);
    }

    fn try_queue(
        &self,
        content: Content,
        reserved: usize,
        related: Option<SampleId>,
    ) -> Result<(), PublishError> {
        if !self.shared.budget.try_take(reserved) {
            return Err(self.full());
        }
        let job = Job::Sample {
            content,
            reserved,
            related,
        };
        self.shared.waiting.fetch_add(1, Relaxed);
        self.jobs.try_send(job).map_err(|error| {
            self.shared.done(reserved);
            match error {
                TrySendError::Full(_) => self.full(),
                TrySendError::Closed(_) => self.closed(),
            }
        })
    }

    fn full(&self) -> PublishError {
        self.shared.drop_one("the queue of the publisher is full");
        PublishError::QueueFull {
            topic: self.shared.topic.clone(),
            dropped: self.dropped(),
        }
    }

    fn closed(&self) -> PublishError {
        PublishError::Closed {
            topic: self.shared.topic.clone(),
        }
    }
}

async fn serve(shared: Arc<Shared>, queue: Receiver<Job>) {
    let mut turn: u32 = 0;
    while let Ok(job) = queue.recv().await {
        turn = turn.wrapping_add(1);
        if turn.is_multiple_of(JOBS_PER_TURN) {
            yield_now().await;
        }
        match job {
            Job::Sample {
                content,
                reserved,
                related,
            } => {
                if let Some(body) = shared.body(content) {
                    shared.write(body, related).await;
                }
                shared.done(reserved);
            }
            Job::Flush(done) => {
                // The receiver may be gone.
                let _ = done.try_send(());
            }
        }
    }
}
