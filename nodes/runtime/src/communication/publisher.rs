//! Publishers of messages and of CDR bytes.

use std::collections::VecDeque;
use std::marker::PhantomData;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use lattice_msgs::RosMessage;
use lattice_msgs::cdr;

use super::lifecycle_gate::LifecycleGate;
use crate::error::PublishError;
use crate::graph::local_graph::NodeEndpoint;
use crate::shutdown::Shutdown;
use crate::sync::lock;
use crate::transport::local_bus::LocalEndpoint;
use crate::transport::outbox::{Outbox, Serialize};
use crate::transport::peers::Peers;
use crate::transport::port::{Bytes, ENCAPSULATION_BYTES};
use crate::transport::qos::Qos;

/// Parts common to both kinds of publisher.
pub(crate) struct PublisherParts {
    pub writer: Arc<Outbox>,
    pub peers: Arc<Peers>,
    pub local: LocalEndpoint,
    /// Messages for late joiners; `None` if volatile, or if the transport keeps them.
    pub latch: Option<Mutex<Latch>>,
    pub shutdown: Shutdown,
    pub _graph: NodeEndpoint,
}

/// Last messages of a latched publisher without remote subscribers so far. They are
/// serialized for the first one; from then on DDS keeps them.
pub(crate) struct Latch {
    kept: VecDeque<Serialize>,
    depth: usize,
    /// True if the node republishes for late joiners: DDS has nothing to keep without subscribers.
    renewed: bool,
    heard: bool,
}

impl Latch {
    /// Keeps as many messages as `qos` specifies for late joiners.
    pub(crate) fn new(qos: &Qos) -> Self {
        Self {
            kept: VecDeque::new(),
            depth: qos.kept(),
            renewed: qos.kept.is_some(),
            heard: false,
        }
    }
}

impl PublisherParts {
    /// True if a volatile message, or one that the transport keeps, is to be passed to it.
    fn is_wanted(&self) -> bool {
        let writer = &self.writer;
        self.peers.remote() > 0 || writer.has_reader() || writer.keeps_samples()
    }

    fn send(&self, message: Serialize) -> Result<(), PublishError> {
        let remote = self.peers.remote() > 0;
        let Some(latch) = &self.latch else {
            return match self.is_wanted() {
                true => self.writer.send(message),
                false => Ok(()),
            };
        };
        let mut latch = lock(latch);
        if remote || latch.heard && !latch.renewed {
            self.release(&mut latch);
            return self.writer.send(message);
        }
        while latch.kept.len() >= latch.depth {
            latch.kept.pop_front();
        }
        latch.kept.push_back(message);
        Ok(())
    }

    /// Passes kept messages to DDS once another process subscribes.
    pub(crate) fn peer_joined(&self) {
        if let Some(latch) = &self.latch
            && self.peers.remote() > 0
        {
            self.release(&mut lock(latch));
        }
    }

    fn release(&self, latch: &mut Latch) {
        latch.heard = true;
        for message in latch.kept.drain(..) {
            // A full queue is counted as a drop.
            let _ = self.writer.send(message);
        }
    }
}

/// Publisher of one message type on one topic. Clones share the publisher.
pub struct Publisher<M> {
    pub(crate) parts: Arc<PublisherParts>,
    /// Lifecycle gate of the node.
    pub(crate) gate: Option<Arc<LifecycleGate>>,
    pub(crate) message: PhantomData<fn(M)>,
}

impl<M> Clone for Publisher<M> {
    fn clone(&self) -> Self {
        Self {
            parts: Arc::clone(&self.parts),
            gate: self.gate.clone(),
            message: PhantomData,
        }
    }
}

impl<M: RosMessage> Publisher<M> {
    /// Publishes a message; returns at once.
    ///
    /// Subscriptions in this runtime receive the same `Arc`. For others it is queued and serialized
    /// on the publisher thread; a full queue is an error, and counted. An inactive managed node
    /// publishes nothing.
    pub fn publish(&self, message: impl Into<Arc<M>>) -> Result<(), PublishError> {
        if self.gate.as_ref().is_some_and(|gate| !gate.is_open()) {
            return Ok(());
        }
        let message: Arc<M> = message.into();
        self.parts.local.publish(&(Arc::clone(&message) as _));
        self.parts
            .send(Box::new(move || cdr::to_vec(message.as_ref())))
    }
}

/// Publisher of messages that are CDR bytes already, as in a bag.
#[derive(Clone)]
pub struct RawPublisher {
    pub(crate) parts: Arc<PublisherParts>,
}

impl RawPublisher {
    /// Publishes a message of plain little-endian CDR, encapsulation header included, unchanged.
    ///
    /// Waits while the queue is full, so nothing is dropped here; the timeout and a shutdown request end the
    /// wait with an error. Not to be called from a handler, callback or timer.
    pub fn publish_within(&self, cdr: Vec<u8>, patience: Duration) -> Result<(), PublishError> {
        let mut body = Bytes::from(cdr);
        if body.get(..2) != Some(&[0, 1]) || body.len() < ENCAPSULATION_BYTES {
            return Err(PublishError::NotLittleEndianCdr {
                topic: self.topic().to_owned(),
                bytes: body.len(),
                header: body.iter().take(ENCAPSULATION_BYTES).copied().collect(),
            });
        }
        if let Err(error) = self.parts.local.publish_cdr(&body) {
            let topic = self.topic();
            log::warn!("{topic}: message not delivered in this process: {error}");
        }
        if self.parts.latch.is_none() && !self.parts.is_wanted() {
            return Ok(());
        }
        let body = body.split_off(ENCAPSULATION_BYTES);
        let shutdown = &self.parts.shutdown;
        self.parts.writer.send_body_within(body, patience, shutdown)
    }

    /// Messages passed to DDS and not acknowledged by reliable subscribers, including subscribers that have left.
    pub fn unacknowledged(&self) -> u64 {
        self.parts.writer.unacknowledged()
    }

    /// Waits until the queue has room for a message of `bytes`. False: timeout. Not to be called from a
    /// handler, callback or timer.
    pub fn has_room_within(&self, bytes: usize, patience: Duration) -> bool {
        self.parts.writer.has_room_within(bytes, patience)
    }
}

macro_rules! shared_by_publishers {
    ($([$($generics:tt)*] $publisher:ty),*) => {$(
        impl<$($generics)*> $publisher {
            /// Resolved topic.
            pub fn topic(&self) -> &str {
                self.parts.peers.topic()
            }

            /// Matched subscribers in all processes; over Zenoh at least 1 if there is one that announces no endpoint.
            pub fn subscriber_count(&self) -> usize {
                let has_reader = self.parts.writer.has_reader();
                self.parts.peers.count().max(usize::from(has_reader))
            }

            /// Calls `callback` at every match with a subscriber, and now if one is matched already.
            ///
            /// It runs on a thread of the runtime and must return at once.
            pub fn on_subscriber_joined(&self, callback: impl FnMut() + Send + 'static) {
                self.parts.peers.on_joined(Box::new(callback));
            }

            /// Waits until the queue is empty and every reliable remote subscriber has
            /// acknowledged. False: timeout. Not from a handler, callback or timer.
            pub fn flush(&self, timeout: Duration) -> bool {
                self.parts.writer.flush(timeout)
            }

            /// True if the queue is empty and every reliable remote subscriber has
            /// acknowledged all. Over Zenoh, which has no acknowledgements: passed to the link.
            pub fn is_acknowledged(&self) -> bool {
                self.parts.writer.is_acknowledged()
            }

            /// Messages not sent to other processes: queue or send window full.
            pub fn dropped(&self) -> u64 {
                self.parts.writer.dropped()
            }

            /// Messages passed to DDS for other processes.
            pub fn sent(&self) -> u64 {
                self.parts.writer.sent()
            }

            /// Serialized bytes of these messages, without headers.
            pub fn sent_bytes(&self) -> u64 {
                self.parts.writer.sent_bytes()
            }
        }
    )*};
}

shared_by_publishers!([M: RosMessage] Publisher<M>, [] RawPublisher);
