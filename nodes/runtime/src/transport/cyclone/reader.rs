//! A Cyclone reader: awaits the next sample as CDR bytes, without polling.

use std::ptr;
use std::sync::{Arc, Mutex, MutexGuard};
use std::task::{Context, Poll};

use lattice_cyclone_sys::{dds_create_reader, lattice_is_known_to};
use smol::channel::Sender;

use super::endpoint::{Description, Endpoint};
use super::entity::Entity;
use super::log::explained;
use super::qos::NativeQos;
use super::sample::Taken;
use crate::sync::lock;
use crate::transport::port::{EndpointId, Origin, PortEvent, ReaderLosses, SampleId, SampleReader};

/// Reader of one topic.
pub(super) struct CycloneReader {
    // Field order is drop order: the topic and the listener's data outlive the reader.
    reader: Entity,
    _topic: Entity,
    endpoint: Arc<Endpoint>,
    buffer: Mutex<Vec<u8>>,
    max_bytes: usize,
}

impl CycloneReader {
    /// Creates a reader. Samples longer than `max_bytes`, header included, are rejected.
    pub(super) fn new(
        participant: &Entity,
        topic: Entity,
        qos: &NativeQos,
        max_bytes: usize,
        description: Description,
        events: Sender<PortEvent>,
    ) -> Result<Self, String> {
        let (parent, of) = (participant.handle(), topic.handle());
        // SAFETY: handles, and a live QoS that is copied; no listener.
        let make = || unsafe { dds_create_reader(parent, of, qos.as_ptr(), ptr::null()) };
        let reader = explained(make)?;
        Ok(Self {
            endpoint: Endpoint::watch(&reader, description, events)?,
            reader,
            _topic: topic,
            buffer: Mutex::default(),
            max_bytes,
        })
    }

    pub(super) fn endpoint(&self) -> &Arc<Endpoint> {
        &self.endpoint
    }

    fn keep(&self, taken: &Taken) -> Result<Origin, String> {
        let (bytes, max) = (taken.bytes(), self.max_bytes);
        if bytes.len() > max {
            let bytes = bytes.len();
            let words = format!("{bytes} bytes exceed max_message_bytes = {max}");
            return Err(words);
        }
        let mut buffer = lock(&self.buffer);
        buffer.clear();
        buffer.extend_from_slice(bytes);
        let writer = self.endpoint.writer(self.reader.handle(), taken.writer());
        Ok(Origin {
            sample: SampleId {
                writer: writer.unwrap_or(EndpointId([0; 16])),
                number: taken.number(),
            },
            related: taken.related(),
        })
    }
}

impl SampleReader for CycloneReader {
    fn id(&self) -> EndpointId {
        self.endpoint.id()
    }

    fn poll_next(&self, context: &mut Context<'_>) -> Poll<Result<Origin, String>> {
        let next = self.endpoint.arrivals().poll_next(context);
        next.map(|taken| self.keep(&taken))
    }

    fn bytes(&self) -> MutexGuard<'_, Vec<u8>> {
        lock(&self.buffer)
    }

    fn is_known_to(&self, writer: &EndpointId) -> bool {
        // SAFETY: a handle, and 16 bytes read during the call.
        unsafe { lattice_is_known_to(self.reader.handle(), writer.0.as_ptr()) }
    }

    fn losses(&self) -> ReaderLosses {
        self.endpoint.arrivals().losses().clone()
    }
}
