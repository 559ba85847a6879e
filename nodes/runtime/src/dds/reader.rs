//! One DDS reader: the next sample as CDR bytes, awaited without polling.

use std::sync::{Mutex, MutexGuard};
use std::task::{Context, Poll};

use rustdds::no_key::SimpleDataReader;
use rustdds::rpc::SampleIdentity;

use super::payload::{CopyInto, PayloadDeserializer, Taken};
use super::{endpoint_id, sample_id};
use crate::port::{EndpointId, Origin, SampleReader};
use crate::sync::lock;

/// Takes samples of one topic.
pub(super) struct DdsReader {
    reader: SimpleDataReader<Taken, PayloadDeserializer>,
    buffer: Mutex<Vec<u8>>,
    max_bytes: usize,
}

impl DdsReader {
    /// Samples longer than `max_bytes`, header included, are refused.
    pub(super) fn new(
        reader: SimpleDataReader<Taken, PayloadDeserializer>,
        max_bytes: usize,
    ) -> Self {
        Self {
            reader,
            buffer: Mutex::new(Vec::new()),
            max_bytes,
        }
    }

    /// Steps over what is there already.
    ///
    /// The readers of a participant share one cache for each topic, so a new reader finds the samples
    /// of those before it, which a volatile reader must not see.
    pub(super) fn skip_old(&self) {
        let look = CopyInto {
            buffer: &self.buffer,
            max_bytes: 0,
        };
        while !matches!(self.reader.try_take_one_with(look.clone()), Ok(None)) {}
    }

    fn try_take(&self) -> Option<Result<Origin, String>> {
        let copy = CopyInto {
            buffer: &self.buffer,
            max_bytes: self.max_bytes,
        };
        let change = match self.reader.try_take_one_with(copy) {
            Ok(change) => change?,
            Err(error) => return Some(Err(error.to_string())),
        };
        Some(match change.sample {
            Taken::Copied => Ok(Origin {
                sample: sample_id(SampleIdentity {
                    writer_guid: change.writer_guid,
                    sequence_number: change.sequence_number,
                }),
                related: change.related_sample_identity().map(sample_id),
            }),
            Taken::TooLong { bytes } => Err(format!(
                "{bytes} bytes are more than max_message_bytes = {}",
                self.max_bytes
            )),
        })
    }
}

impl SampleReader for DdsReader {
    fn id(&self) -> EndpointId {
        endpoint_id(self.reader.guid())
    }

    fn poll_next(&self, context: &mut Context<'_>) -> Poll<Result<Origin, String>> {
        // Undrained, the notifications fill their socket and every sample logs a line.
        self.reader.drain_read_notifications();
        if let Some(sample) = self.try_take() {
            return Poll::Ready(sample);
        }
        self.reader.set_waker(Some(context.waker().clone()));
        // Something may have arrived before the waker was in place.
        self.try_take().map_or(Poll::Pending, Poll::Ready)
    }

    fn bytes(&self) -> MutexGuard<'_, Vec<u8>> {
        lock(&self.buffer)
    }
}
