//! One writer, over the participants that come one after the other.

use std::collections::VecDeque;
use std::pin::pin;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use futures::future::BoxFuture;
use rustdds::dds::WriteError;
use rustdds::no_key::DataWriter;
use rustdds::{RTPSEntity, Timestamp, WriteOptionsBuilder};
use smol::future::{or, poll_once};
use smol::lock::MutexGuard;

use super::large_call::{LargeCall, LargeCalls, MAX_WHOLE_BYTES};
use super::participant::{Participant, Recipe};
use super::payload::{Payload, PayloadSerializer};
use super::{endpoint_id, sample_identity};
use crate::error::RuntimeError;
use crate::port::{Bytes, EndpointId, SampleId, SampleWriter, WriteRefusal};
use crate::sync::{Changed, lock};

pub(super) type RawWriter = DataWriter<Payload, PayloadSerializer>;

/// Writes samples of one topic.
pub(super) struct DdsWriter {
    id: EndpointId,
    pub recipe: Recipe,
    /// Samples kept for the next participant, at most.
    kept: usize,
    state: Mutex<State>,
    changed: Changed,
    large_calls: Arc<LargeCalls>,
    /// Numbers of requests or replies, which are written one after the other.
    calls: smol::lock::Mutex<Calls>,
}

/// Requests or replies of one writer of RustDDS.
struct Calls {
    writer: EndpointId,
    /// Number of the last.
    written: i64,
}

struct State {
    /// Identity on the wire.
    wire_id: EndpointId,
    /// None between two participants.
    raw: Option<Arc<RawWriter>>,
    /// Last samples of a latched topic. Their bytes are shared with RustDDS.
    kept: VecDeque<Sample>,
}

#[derive(Clone)]
struct Sample {
    body: Bytes,
    related: Option<SampleId>,
    stamp: Timestamp,
}

impl Calls {
    /// Identity that the next one gets.
    fn next(&self) -> SampleId {
        SampleId {
            writer: self.writer,
            number: self.written.saturating_add(1),
        }
    }
}

impl DdsWriter {
    pub(super) fn new(
        participant: &Participant,
        recipe: Recipe,
        large_calls: Arc<LargeCalls>,
    ) -> Result<Self, RuntimeError> {
        let raw = participant.writer(&recipe)?;
        let id = endpoint_id(raw.guid());
        // What is no ROS topic is the graph, which names endpoints of one participant.
        Ok(Self {
            id,
            kept: if recipe.is_ros_topic() {
                recipe.qos.kept()
            } else {
                0
            },
            recipe,
            state: Mutex::new(State {
                wire_id: id,
                raw: Some(Arc::new(raw)),
                kept: VecDeque::new(),
            }),
            changed: Changed::default(),
            large_calls,
            calls: smol::lock::Mutex::new(Calls {
                writer: id,
                written: 0,
            }),
        })
    }

    pub(super) fn wire_id(&self) -> EndpointId {
        lock(&self.state).wire_id
    }

    /// Leaves a participant that ends.
    pub(super) fn leave(&self) {
        let raw = lock(&self.state).raw.take();
        drop(raw);
        self.changed.notify();
    }

    /// Joins a participant and writes there what it has kept.
    pub(super) fn join(&self, participant: &Participant) -> Result<(), RuntimeError> {
        let raw = participant.writer(&self.recipe)?;
        let mut state = lock(&self.state);
        for sample in &state.kept {
            let options = options(sample).build();
            let payload = Payload(sample.body.clone());
            if let Err(error) = raw.write_with_options(payload, options) {
                log::warn!(
                    "{}: a latched message was lost: {error:?}",
                    self.recipe.name
                );
            }
        }
        state.wire_id = endpoint_id(raw.guid());
        state.raw = Some(Arc::new(raw));
        drop(state);
        self.changed.notify();
        Ok(())
    }

    fn raw(&self) -> Option<Arc<RawWriter>> {
        lock(&self.state).raw.clone()
    }

    fn is_now(&self, raw: &Arc<RawWriter>) -> bool {
        (lock(&self.state).raw.as_ref()).is_some_and(|now| Arc::ptr_eq(now, raw))
    }

    /// Keeps a sample that `raw` has taken. False: another writer has come, which has not got it.
    fn keep(&self, raw: &Arc<RawWriter>, sample: &Sample) -> bool {
        if self.kept == 0 {
            return true;
        }
        let mut state = lock(&self.state);
        if (state.raw.as_ref()).is_some_and(|now| !Arc::ptr_eq(now, raw)) {
            return false;
        }
        while state.kept.len() >= self.kept {
            state.kept.pop_front();
        }
        state.kept.push_back(sample.clone());
        true
    }

    /// The numbers of calls, held while one is written. None: this writes none.
    async fn calls(&self, raw: &RawWriter) -> Option<MutexGuard<'_, Calls>> {
        if !self.recipe.is_service() {
            return None;
        }
        let mut calls = self.calls.lock().await;
        let writer = endpoint_id(raw.guid());
        if calls.writer != writer {
            *calls = Calls { writer, written: 0 };
        }
        Some(calls)
    }

    async fn write_sample(&self, sample: &Sample, may_wait: bool) -> Result<(), WriteRefusal> {
        loop {
            let raw = match self.raw() {
                Some(raw) => raw,
                None => self.changed.until(|| self.raw()).await,
            };
            let mut calls = self.calls(&raw).await;
            let mut options = options(sample).best_effort_may_block(may_wait);
            if let Some(calls) = &calls
                && let Some(related) = sample.related
                && sample.body.len() > MAX_WHOLE_BYTES
            {
                self.large_calls.send(&LargeCall {
                    sample: calls.next(),
                    related,
                    body: &sample.body,
                });
                options = options.related_sample_identity_opt(None);
            }
            let options = options.build();
            let write = raw.async_write_with_options(Payload(sample.body.clone()), options);
            let mut write = pin!(async { Some(write.await) });
            // Nearly always done at once.
            let written = match poll_once(&mut write).await {
                Some(written) => written,
                None => {
                    or(
                        write,
                        self.changed.until(|| (!self.is_now(&raw)).then_some(None)),
                    )
                    .await
                }
            };
            if let (Some(calls), Some(Ok(sample))) = (&mut calls, &written) {
                calls.written = sample.sequence_number.into();
            }
            match written {
                Some(Ok(_)) if self.keep(&raw, sample) => return Ok(()),
                Some(Ok(_)) | None => {}
                Some(Err(WriteError::WouldBlock { .. })) => return Err(WriteRefusal::Full),
                Some(Err(error)) => return Err(WriteRefusal::Failed(format!("{error:?}"))),
            }
        }
    }
}

fn options(sample: &Sample) -> WriteOptionsBuilder {
    WriteOptionsBuilder::new()
        .source_timestamp(sample.stamp)
        .related_sample_identity_opt(sample.related.map(sample_identity))
}

impl SampleWriter for DdsWriter {
    fn id(&self) -> EndpointId {
        self.id
    }

    fn write(
        &self,
        body: Bytes,
        related: Option<SampleId>,
        may_wait: bool,
    ) -> BoxFuture<'_, Result<(), WriteRefusal>> {
        let sample = Sample {
            body,
            related,
            stamp: Timestamp::now(),
        };
        Box::pin(async move { self.write_sample(&sample, may_wait).await })
    }

    fn wait_for_acknowledgments(&self, patience: Duration) -> bool {
        let all = |raw: Arc<RawWriter>| raw.wait_for_acknowledgments(patience);
        self.raw().is_some_and(|raw| all(raw).is_ok_and(|all| all))
    }
}
