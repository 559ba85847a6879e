//! One reader, over the participants that come one after the other: the next sample as CDR bytes,
//! awaited without polling.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, MutexGuard};
use std::task::{Context, Poll, Waker};

use rustdds::no_key::SimpleDataReader;
use rustdds::rpc::SampleIdentity;

use super::participant::{Participant, Recipe};
use super::payload::{CopyInto, PayloadDeserializer, Taken};
use super::{endpoint_id, sample_id};
use crate::error::RuntimeError;
use crate::port::{EndpointId, Origin, SampleReader};
use crate::qos::Durability;
use crate::sync::lock;

pub(super) type RawReader = SimpleDataReader<Taken, PayloadDeserializer>;

/// Writers of another type that are remembered, at most.
const MAX_REFUSED: usize = 1024;

/// Takes samples of one topic.
pub(super) struct DdsReader {
    id: EndpointId,
    source: Arc<ReaderSource>,
    buffer: Mutex<Vec<u8>>,
    max_bytes: usize,
}

/// The reader in the participant that is now.
pub(super) struct ReaderSource {
    id: EndpointId,
    pub recipe: Recipe,
    state: Mutex<State>,
}

struct State {
    /// Identity on the wire.
    wire_id: EndpointId,
    /// None between two participants.
    raw: Option<Arc<RawReader>>,
    waker: Option<Waker>,
    /// Writers of another type.
    refused: BTreeSet<EndpointId>,
}

impl ReaderSource {
    pub(super) fn id(&self) -> EndpointId {
        self.id
    }

    pub(super) fn wire_id(&self) -> EndpointId {
        lock(&self.state).wire_id
    }

    /// Takes no samples of a writer.
    pub(super) fn refuse(&self, writer: EndpointId) {
        let mut state = lock(&self.state);
        if state.refused.len() < MAX_REFUSED {
            state.refused.insert(writer);
        }
    }

    fn refuses(&self, writer: EndpointId) -> bool {
        lock(&self.state).refused.contains(&writer)
    }

    /// Leaves a participant that ends.
    pub(super) fn leave(&self) {
        let mut state = lock(&self.state);
        state.refused.clear();
        drop(state.raw.take());
    }

    /// Joins a participant, unless it was made there.
    pub(super) fn join(&self, participant: &Participant) -> Result<(), RuntimeError> {
        let mut state = lock(&self.state);
        if state.raw.is_some() {
            return Ok(());
        }
        let raw = raw_reader(participant, &self.recipe)?;
        state.wire_id = endpoint_id(raw.guid());
        state.raw = Some(Arc::new(raw));
        if let Some(waker) = state.waker.take() {
            waker.wake();
        }
        Ok(())
    }

    /// The reader that is now, with `waker` put where the next sample or reader wakes it.
    fn raw(&self, waker: &Waker) -> Option<Arc<RawReader>> {
        let mut state = lock(&self.state);
        match &mut state.waker {
            Some(before) => before.clone_from(waker),
            before @ None => *before = Some(waker.clone()),
        }
        state.raw.clone()
    }
}

/// A new reader that steps over what it must not see.
fn raw_reader(participant: &Participant, recipe: &Recipe) -> Result<RawReader, RuntimeError> {
    let raw = participant.reader(recipe)?;
    // The readers of a participant share one cache for each topic, so a new reader finds the samples
    // of those before it, which a volatile reader must not see.
    if recipe.qos.durability == Durability::Volatile {
        let buffer = Mutex::default();
        let look = CopyInto {
            buffer: &buffer,
            max_bytes: 0,
        };
        while !matches!(raw.try_take_one_with(look.clone()), Ok(None)) {}
    }
    Ok(raw)
}

impl DdsReader {
    /// Samples longer than `max_bytes`, header included, are refused.
    pub(super) fn new(
        participant: &Participant,
        recipe: Recipe,
        max_bytes: usize,
    ) -> Result<Self, RuntimeError> {
        let raw = raw_reader(participant, &recipe)?;
        let id = endpoint_id(raw.guid());
        let state = State {
            wire_id: id,
            raw: Some(Arc::new(raw)),
            waker: None,
            refused: BTreeSet::new(),
        };
        Ok(Self {
            id,
            source: Arc::new(ReaderSource {
                id,
                recipe,
                state: Mutex::new(state),
            }),
            buffer: Mutex::new(Vec::new()),
            max_bytes,
        })
    }

    /// The part that goes from one participant to the next.
    pub(super) fn source(&self) -> &Arc<ReaderSource> {
        &self.source
    }

    fn try_take(&self, raw: &RawReader) -> Option<Result<Origin, String>> {
        let copy = CopyInto {
            buffer: &self.buffer,
            max_bytes: self.max_bytes,
        };
        let change = loop {
            match raw.try_take_one_with(copy.clone()) {
                Ok(Some(change)) if self.source.refuses(endpoint_id(change.writer_guid)) => {}
                Ok(change) => break change?,
                Err(error) => return Some(Err(error.to_string())),
            }
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
        self.id
    }

    fn poll_next(&self, context: &mut Context<'_>) -> Poll<Result<Origin, String>> {
        let Some(raw) = self.source.raw(context.waker()) else {
            return Poll::Pending;
        };
        // Undrained, the notifications fill their socket and every sample logs a line.
        raw.drain_read_notifications();
        if let Some(sample) = self.try_take(&raw) {
            return Poll::Ready(sample);
        }
        raw.set_waker(Some(context.waker().clone()));
        // Something may have arrived before the waker was in place.
        self.try_take(&raw).map_or(Poll::Pending, Poll::Ready)
    }

    fn bytes(&self) -> MutexGuard<'_, Vec<u8>> {
        lock(&self.buffer)
    }
}
