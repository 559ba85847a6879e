//! One writer of Cyclone.

use std::ptr;
use std::sync::Arc;
use std::time::Duration;

use cyclors::{
    DDS_RETCODE_TIMEOUT, dds_create_writer, dds_entity_t, dds_get_entity_sertype,
    dds_wait_for_acks, dds_writecdr, ddsi_sertype,
};
use futures::future::BoxFuture;
use smol::channel::Sender;

use super::endpoint::{Description, Endpoint};
use super::entity::{Entity, check};
use super::log::explained;
use super::qos::NativeQos;
use super::sample::Serialised;
use crate::port::{Bytes, EndpointId, PortEvent, SampleId, SampleWriter, WriteRefusal};

/// Time between two looks at a full send window, unless all readers acknowledge before.
const PATIENCE: Duration = Duration::from_millis(100);

/// Writes samples of one topic.
pub(super) struct CycloneWriter {
    // In this order: the topic outlives the writer, what listeners use outlives both.
    writer: Entity,
    _topic: Entity,
    endpoint: Arc<Endpoint>,
}

impl CycloneWriter {
    pub(super) fn new(
        participant: &Entity,
        topic: Entity,
        qos: &NativeQos,
        description: Description,
        events: Sender<PortEvent>,
    ) -> Result<Self, String> {
        let (parent, of) = (participant.handle(), topic.handle());
        // SAFETY: handles, and a QoS that is alive and copied; no listener.
        let make = || unsafe { dds_create_writer(parent, of, qos.as_ptr(), ptr::null()) };
        let writer = explained(make)?;
        Ok(Self {
            endpoint: Endpoint::watch(&writer, description, events)?,
            writer,
            _topic: topic,
        })
    }

    pub(super) fn endpoint(&self) -> &Arc<Endpoint> {
        &self.endpoint
    }

    fn try_write(&self, body: &[u8]) -> Result<(), WriteRefusal> {
        let mut sertype: *const ddsi_sertype = ptr::null();
        // SAFETY: writes a pointer to `sertype`.
        let code = unsafe { dds_get_entity_sertype(self.writer.handle(), &mut sertype) };
        let _ = check(code).map_err(WriteRefusal::Failed)?;
        // SAFETY: the type is that of our writer, which is alive.
        let sample = unsafe { Serialised::from_body(sertype, body) };
        let sample = sample.ok_or_else(|| {
            let bytes = body.len();
            WriteRefusal::Failed(format!("{bytes} bytes are more than a sample can have"))
        })?;
        // SAFETY: Cyclone gives the reference back, also when it fails.
        match unsafe { dds_writecdr(self.writer.handle(), sample.into_raw()) } {
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
        _may_wait: bool,
    ) -> BoxFuture<'_, Result<(), WriteRefusal>> {
        Box::pin(async move {
            if related.is_some() {
                let words = "Cyclone DDS cannot say which request a sample answers";
                return Err(WriteRefusal::Failed(words.to_owned()));
            }
            let written = self.try_write(&body);
            if matches!(written, Err(WriteRefusal::Full)) {
                let writer = self.writer.handle();
                let _ = smol::unblock(move || wait_for_acks(writer, PATIENCE)).await;
            }
            written
        })
    }

    fn wait_for_acknowledgments(&self, patience: Duration) -> bool {
        wait_for_acks(self.writer.handle(), patience)
    }
}

/// Waits until all readers have acknowledged. False: not in time, or the writer is gone.
fn wait_for_acks(writer: dds_entity_t, patience: Duration) -> bool {
    let patience_ns = i64::try_from(patience.as_nanos()).unwrap_or(i64::MAX);
    // SAFETY: a handle and a number.
    check(unsafe { dds_wait_for_acks(writer, patience_ns) }).is_ok()
}
