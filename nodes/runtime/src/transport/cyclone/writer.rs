//! A Cyclone writer.

use std::ptr;
use std::sync::Arc;
use std::time::Duration;

use futures::future::BoxFuture;
use lattice_cyclone_sys::{
    DDS_RETCODE_TIMEOUT, dds_entity_t, dds_wait_for_acks, lattice_identity, lattice_is_full,
    lattice_unacknowledged, lattice_write, lattice_writer,
};
use smol::channel::Sender;

use super::endpoint::{Description, Endpoint};
use super::entity::{Entity, check};
use super::log::explained;
use super::qos::NativeQos;
use crate::transport::port::{
    Bytes, EndpointId, PortEvent, SampleId, SampleWriter, UNACKNOWLEDGED_BYTES, WriteRefusal,
};

/// Period of checks of a full send window, unless all readers acknowledge earlier.
const PATIENCE: Duration = Duration::from_millis(100);

/// Writer of one topic.
pub(super) struct CycloneWriter {
    // Field order is drop order: the topic and the listener's data outlive the writer.
    writer: Entity,
    _topic: Entity,
    endpoint: Arc<Endpoint>,
    keeps: bool,
}

impl CycloneWriter {
    pub(super) fn new(
        participant: &Entity,
        topic: Entity,
        (qos, keeps): (&NativeQos, bool),
        description: Description,
        events: Sender<PortEvent>,
    ) -> Result<Self, String> {
        let (parent, of) = (participant.handle(), topic.handle());
        // SAFETY: handles, and a live QoS that is copied.
        let make = || unsafe { lattice_writer(parent, of, qos.as_ptr(), keeps) };
        let writer = explained(make)?;
        Ok(Self {
            endpoint: Endpoint::watch(&writer, description, events)?,
            writer,
            _topic: topic,
            keeps,
        })
    }

    pub(super) fn endpoint(&self) -> &Arc<Endpoint> {
        &self.endpoint
    }

    fn try_write(&self, body: &[u8], related: Option<SampleId>) -> Result<(), WriteRefusal> {
        let writer = self.writer.handle();
        // SAFETY: a handle and numbers.
        if self.keeps && unsafe { lattice_is_full(writer, body.len(), UNACKNOWLEDGED_BYTES) } {
            return Err(WriteRefusal::Full);
        }
        let identity = related.map(|SampleId { writer, number }| lattice_identity {
            guid: writer.0,
            number,
        });
        let identity = identity.as_ref().map_or(ptr::null(), ptr::from_ref);
        // SAFETY: `body.len()` bytes, and an identity or null, are read during the call.
        let code = unsafe {
            let (bytes, count) = (body.as_ptr(), body.len());
            lattice_write(writer, bytes, count, identity)
        };
        match code {
            DDS_RETCODE_TIMEOUT => Err(WriteRefusal::Full),
            code => check(code).map(drop).map_err(WriteRefusal::Failed),
        }
    }
}

impl SampleWriter for CycloneWriter {
    fn id(&self) -> EndpointId {
        self.endpoint.id()
    }

    fn write(
        &self,
        body: Bytes,
        related: Option<SampleId>,
    ) -> BoxFuture<'_, Result<(), WriteRefusal>> {
        Box::pin(async move {
            let written = self.try_write(&body, related);
            if matches!(written, Err(WriteRefusal::Full)) {
                let writer = self.writer.handle();
                let _ = smol::unblock(move || wait_for_acks(writer, PATIENCE)).await;
            }
            written
        })
    }

    fn unacknowledged(&self) -> u64 {
        // SAFETY: a handle.
        let waiting = unsafe { lattice_unacknowledged(self.writer.handle()) };
        self.endpoint.unacknowledged().saturating_add(waiting)
    }

    fn wait_for_acknowledgments(&self, patience: Duration) -> bool {
        wait_for_acks(self.writer.handle(), patience)
    }
}

/// Waits until all readers have acknowledged. False: timeout, or the writer is deleted.
fn wait_for_acks(writer: dds_entity_t, patience: Duration) -> bool {
    let patience_ns = i64::try_from(patience.as_nanos()).unwrap_or(i64::MAX);
    // SAFETY: a handle and a number.
    check(unsafe { dds_wait_for_acks(writer, patience_ns) }).is_ok()
}
