//! Publishers of messages and of CDR bytes.

use std::marker::PhantomData;
use std::sync::Arc;
use std::time::Duration;

use lattice_msgs::RosMessage;
use lattice_msgs::cdr;
use rustdds::bytes::Bytes;

use super::dds::payload::ENCAPSULATION_BYTES;
use super::dds::writer::DdsWriter;
use super::error::PublishError;
use super::graph;
use super::local_bus::Membership;
use super::peers::Peers;

/// What both kinds of publisher are made of.
pub(crate) struct Core {
    pub writer: DdsWriter,
    pub peers: Arc<Peers>,
    pub local: Membership,
    /// Keeps messages for late joiners, so it must hear every one.
    pub latched: bool,
    pub _graph: graph::Membership,
}

impl Core {
    fn wants_dds(&self) -> bool {
        self.latched || self.peers.remote() > 0
    }
}

/// Publishes messages of one type on one topic. Clones share the publisher.
pub struct Publisher<M> {
    core: Arc<Core>,
    message: PhantomData<fn(M)>,
}

impl<M> Clone for Publisher<M> {
    fn clone(&self) -> Self {
        Self {
            core: Arc::clone(&self.core),
            message: PhantomData,
        }
    }
}

impl<M: RosMessage> Publisher<M> {
    pub(crate) fn new(core: Arc<Core>) -> Self {
        Self {
            core,
            message: PhantomData,
        }
    }

    /// Publishes a message; returns at once.
    ///
    /// Subscriptions in this runtime get the same `Arc`. For others it is queued, to be serialized
    /// on the publisher thread; a full queue is an error, and counted.
    pub fn publish(&self, message: impl Into<Arc<M>>) -> Result<(), PublishError> {
        let message: Arc<M> = message.into();
        self.core.local.publish(&(Arc::clone(&message) as _));
        if !self.core.wants_dds() {
            return Ok(());
        }
        self.core
            .writer
            .send(Box::new(move || cdr::to_vec(message.as_ref())))
    }
}

/// Publishes messages that are CDR bytes already, as a bag player has them.
#[derive(Clone)]
pub struct RawPublisher {
    core: Arc<Core>,
}

impl RawPublisher {
    pub(crate) fn new(core: Arc<Core>) -> Self {
        Self { core }
    }

    /// Publishes a message of plain little-endian CDR, encapsulation header included, as it is.
    ///
    /// Waits while the queue is full, so nothing is lost on this side. Not to be called from a
    /// handler, callback or timer.
    pub fn publish_blocking(&self, cdr: Vec<u8>) -> Result<(), PublishError> {
        let mut body = Bytes::from(cdr);
        if body.get(..2) != Some(&[0, 1]) || body.len() < ENCAPSULATION_BYTES {
            return Err(PublishError::NotLittleEndianCdr {
                topic: self.topic().to_owned(),
                bytes: body.len(),
                header: body.iter().take(ENCAPSULATION_BYTES).copied().collect(),
            });
        }
        if let Err(error) = self.core.local.publish_cdr(&body) {
            log::warn!(
                "{}: message not given to this process: {error}",
                self.topic()
            );
        }
        if !self.core.wants_dds() {
            return Ok(());
        }
        self.core
            .writer
            .send_body_blocking(body.split_off(ENCAPSULATION_BYTES))
    }
}

macro_rules! shared_by_publishers {
    ($([$($generics:tt)*] $publisher:ty),*) => {$(
        impl<$($generics)*> $publisher {
            /// Resolved topic.
            pub fn topic(&self) -> &str {
                self.core.peers.topic()
            }

            /// Matched subscribers, here and in other processes.
            pub fn subscriber_count(&self) -> usize {
                self.core.peers.count()
            }

            /// Calls `callback` for every subscriber that joins, and now if there is one already.
            ///
            /// It runs on a thread of the runtime and must return at once.
            pub fn on_subscriber_joined(&self, callback: impl FnMut() + Send + 'static) {
                self.core.peers.on_joined(Box::new(callback));
            }

            /// Waits until the queue is empty and every reliable subscriber in another process has
            /// acknowledged. False: not in time. Not from a handler, callback or timer.
            pub fn flush(&self, timeout: Duration) -> bool {
                self.core.writer.flush(timeout)
            }

            /// Messages not sent to other processes: queue or send window full.
            pub fn dropped(&self) -> u64 {
                self.core.writer.dropped()
            }

            /// Messages handed to DDS for other processes.
            pub fn sent(&self) -> u64 {
                self.core.writer.sent()
            }
        }
    )*};
}

shared_by_publishers!([M: RosMessage] Publisher<M>, [] RawPublisher);
