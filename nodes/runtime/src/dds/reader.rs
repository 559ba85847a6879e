//! One DDS reader: the next sample as CDR bytes, awaited without polling.

use std::future::poll_fn;
use std::sync::{Mutex, MutexGuard};
use std::task::Poll;

use rustdds::no_key::SimpleDataReader;
use rustdds::rpc::SampleIdentity;
use rustdds::{GUID, SequenceNumber};

use super::payload::{CopyInto, PayloadDeserializer, Taken};
use crate::sync::lock;

/// Where a sample came from.
#[derive(Clone, Debug)]
pub(crate) struct SampleOrigin {
    /// The writer that sent it.
    pub writer: GUID,
    /// Its number at that writer.
    pub sequence_number: SequenceNumber,
    /// The request it belongs to, where the sender said so.
    pub related: Option<SampleIdentity>,
}

/// Takes samples of one topic.
pub(crate) struct DdsReader {
    reader: SimpleDataReader<Taken, PayloadDeserializer>,
    buffer: Mutex<Vec<u8>>,
    max_bytes: usize,
}

impl DdsReader {
    /// Samples longer than `max_bytes`, header included, are refused.
    pub(crate) fn new(
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
    pub(crate) fn skip_old(&self) {
        let look = CopyInto {
            buffer: &self.buffer,
            max_bytes: 0,
        };
        while !matches!(self.reader.try_take_one_with(look.clone()), Ok(None)) {}
    }

    pub(crate) fn guid(&self) -> GUID {
        self.reader.guid()
    }

    /// The next sample; its bytes are in [`DdsReader::bytes`] until the next call.
    ///
    /// The error is a sample that cannot be had, in words. RustDDS has stepped over it.
    pub(crate) async fn next(&self) -> Result<SampleOrigin, String> {
        poll_fn(|context| {
            // Undrained, the notifications fill their socket and every sample logs a line.
            self.reader.drain_read_notifications();
            if let Some(sample) = self.try_take() {
                return Poll::Ready(sample);
            }
            self.reader.set_waker(Some(context.waker().clone()));
            // Something may have arrived before the waker was in place.
            self.try_take().map_or(Poll::Pending, Poll::Ready)
        })
        .await
    }

    /// Bytes of the last sample, encapsulation header first.
    pub(crate) fn bytes(&self) -> MutexGuard<'_, Vec<u8>> {
        lock(&self.buffer)
    }

    fn try_take(&self) -> Option<Result<SampleOrigin, String>> {
        let copy = CopyInto {
            buffer: &self.buffer,
            max_bytes: self.max_bytes,
        };
        let change = match self.reader.try_take_one_with(copy) {
            Ok(change) => change?,
            Err(error) => return Some(Err(error.to_string())),
        };
        Some(match change.sample {
            Taken::Copied => Ok(SampleOrigin {
                writer: change.writer_guid,
                sequence_number: change.sequence_number,
                related: change.related_sample_identity(),
            }),
            Taken::TooLong { bytes } => Err(format!(
                "{bytes} bytes are more than max_message_bytes = {}",
                self.max_bytes
            )),
        })
    }
}
