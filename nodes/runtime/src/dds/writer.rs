//! One DDS writer.

use std::time::Duration;

use futures::future::BoxFuture;
use rustdds::dds::WriteError;
use rustdds::no_key::DataWriter;
use rustdds::{RTPSEntity, Timestamp, WriteOptionsBuilder};

use super::payload::{Payload, PayloadSerializer};
use super::{endpoint_id, sample_identity};
use crate::port::{Bytes, EndpointId, SampleId, SampleWriter, WriteRefusal};

pub(super) type RawWriter = DataWriter<Payload, PayloadSerializer>;

/// Writes samples of one topic.
pub(super) struct DdsWriter(pub RawWriter);

impl SampleWriter for DdsWriter {
    fn id(&self) -> EndpointId {
        endpoint_id(self.0.guid())
    }

    fn write(
        &self,
        body: Bytes,
        related: Option<SampleId>,
        may_wait: bool,
    ) -> BoxFuture<'_, Result<(), WriteRefusal>> {
        let options = WriteOptionsBuilder::new()
            .source_timestamp(Timestamp::now())
            .related_sample_identity_opt(related.map(sample_identity))
            .best_effort_may_block(may_wait)
            .build();
        Box::pin(async move {
            let written = self.0.async_write_with_options(Payload(body), options);
            match written.await {
                Ok(_) => Ok(()),
                Err(WriteError::WouldBlock { .. }) => Err(WriteRefusal::Full),
                Err(error) => Err(WriteRefusal::Failed(format!("{error:?}"))),
            }
        })
    }

    fn wait_for_acknowledgments(&self, patience: Duration) -> bool {
        self.0
            .wait_for_acknowledgments(patience)
            .is_ok_and(|all| all)
    }
}
