//! The participants of a process, one after the other, and the endpoints that go from each to the next.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, Weak};

use futures::future::BoxFuture;

use super::addresses::Addresses;
use super::goodbye;
use super::large_call::LargeCalls;
use super::participant::{Participant, Recipe};
use super::reader::{DdsReader, ReaderSource};
use super::writer::DdsWriter;
use crate::error::RuntimeError;
use crate::port::{EndpointId, SampleWriter};
use crate::sync::lock;

/// The participant that is now, and its endpoints.
pub(super) struct Lives {
    domain: u16,
    localhost_only: bool,
    /// Identity of the first participant, by which all are known above.
    id: EndpointId,
    renewals: AtomicU64,
    addresses: Arc<Addresses>,
    large_calls: Arc<LargeCalls>,
    now: Mutex<Now>,
}

struct Now {
    /// None while there is no way to make one.
    participant: Option<Arc<Participant>>,
    wire_id: EndpointId,
    writers: Vec<Weak<DdsWriter>>,
    readers: Vec<Weak<ReaderSource>>,
    writers_made: u64,
}

impl Lives {
    pub(super) fn begin(domain: u16, localhost_only: bool) -> Result<Self, RuntimeError> {
        let participant = Participant::join(domain, localhost_only)?;
        let id = participant.id();
        let addresses = Arc::new(Addresses::new(domain, localhost_only));
        Ok(Self {
            domain,
            localhost_only,
            id,
            renewals: AtomicU64::new(0),
            large_calls: Arc::new(LargeCalls::new(Arc::clone(&addresses))),
            addresses,
            now: Mutex::new(Now {
                participant: Some(Arc::new(participant)),
                wire_id: id,
                writers: Vec::new(),
                readers: Vec::new(),
                writers_made: 0,
            }),
        })
    }

    pub(super) fn id(&self) -> EndpointId {
        self.id
    }

    pub(super) fn addresses(&self) -> &Arc<Addresses> {
        &self.addresses
    }

    /// Participants made after the first.
    pub(super) fn renewals(&self) -> u64 {
        self.renewals.load(Relaxed)
    }

    pub(super) fn participant(&self) -> Option<Arc<Participant>> {
        lock(&self.now).participant.clone()
    }

    pub(super) fn writer(&self, recipe: Recipe) -> Result<Arc<DdsWriter>, RuntimeError> {
        let mut now = lock(&self.now);
        let participant = now.participant(&recipe.name, "publisher")?;
        let large_calls = Arc::clone(&self.large_calls);
        let writer = DdsWriter::new(&participant, recipe, large_calls)?;
        let writer = Arc::new(writer);
        now.writers.retain(|writer| writer.strong_count() > 0);
        now.writers.push(Arc::downgrade(&writer));
        now.writers_made = now.writers_made.wrapping_add(1);
        Ok(writer)
    }

    pub(super) fn reader(
        &self,
        recipe: Recipe,
        max_bytes: usize,
    ) -> Result<DdsReader, RuntimeError> {
        let mut now = lock(&self.now);
        let participant = now.participant(&recipe.name, "subscription")?;
        let reader = DdsReader::new(&participant, recipe, max_bytes)?;
        now.readers.retain(|reader| reader.strong_count() > 0);
        now.readers.push(Arc::downgrade(reader.source()));
        Ok(reader)
    }

    /// The identity that an endpoint of ours, or the participant, has on the wire now.
    pub(super) fn wire_id(&self, id: EndpointId) -> EndpointId {
        let now = lock(&self.now);
        if id == self.id {
            return now.wire_id;
        }
        now.ids().find(|ids| ids.0 == id).map_or(id, |ids| ids.1)
    }

    /// The identity by which an endpoint of ours is known above.
    pub(super) fn known_id(&self, wire_id: EndpointId) -> EndpointId {
        let now = lock(&self.now);
        let known = now.ids().find(|ids| ids.1 == wire_id);
        known.map_or(wire_id, |ids| ids.0)
    }

    /// The types, in words, if a peer on the wire has another than our endpoint there. A reader refuses
    /// the samples of such a peer.
    pub(super) fn other_type(
        &self,
        wire_id: EndpointId,
        peer: EndpointId,
        theirs: &str,
    ) -> Option<String> {
        let now = lock(&self.now);
        if let Some(writer) = now.writers().find(|writer| writer.wire_id() == wire_id) {
            let (ours, theirs) = writer.recipe.other_type(theirs)?;
            return Some(format!(
                "type (the publisher has {ours}, the subscription {theirs})"
            ));
        }
        let reader = now.readers().find(|reader| reader.wire_id() == wire_id)?;
        let (ours, theirs) = reader.recipe.other_type(theirs)?;
        reader.refuse(peer);
        Some(format!(
            "type (the publisher has {theirs}, the subscription {ours})"
        ))
    }

    /// A wait for discovery to know the writers made so far, with their number.
    pub(super) fn writers_known(&self) -> Result<(u64, BoxFuture<'static, ()>), RuntimeError> {
        let now = lock(&self.now);
        let wait = now.participant("discovery", "publisher")?.writers_known()?;
        Ok((now.writers_made, wait))
    }

    /// Ends the participant, leaving its endpoints without one. Makers of endpoints wait meanwhile.
    pub(super) fn end(&self) {
        let mut now = lock(&self.now);
        now.writers().for_each(|writer| writer.leave());
        now.readers().for_each(|reader| reader.leave());
        if let Some(participant) = now.participant.take() {
            let is_mute = !participant.is_alive();
            drop(participant);
            if is_mute {
                goodbye::say(self.domain, self.localhost_only, now.wire_id);
            }
        }
    }

    /// Makes a participant without endpoints of ours.
    pub(super) fn spare(&self) -> Result<Participant, RuntimeError> {
        Participant::join(self.domain, self.localhost_only)
    }

    /// Makes all writers in a new participant, `spare` if there is one. They write there what they
    /// have kept.
    pub(super) fn renew(
        &self,
        spare: Option<Arc<Participant>>,
    ) -> Result<Arc<Participant>, RuntimeError> {
        let mut now = lock(&self.now);
        let participant = match spare {
            Some(participant) => participant,
            None => Arc::new(self.spare()?),
        };
        now.writers()
            .try_for_each(|writer| writer.join(&participant))?;
        now.wire_id = participant.id();
        now.writers_made = now.writers_made.wrapping_add(1);
        now.participant = Some(Arc::clone(&participant));
        self.renewals.fetch_add(1, Relaxed);
        Ok(participant)
    }

    /// Makes the readers again, unless a writer was made since. True: done.
    pub(super) fn renew_readers(&self, writers_made: u64) -> Result<bool, RuntimeError> {
        let now = lock(&self.now);
        if now.writers_made != writers_made {
            return Ok(false);
        }
        let participant = now.participant("all", "subscription")?;
        now.readers()
            .try_for_each(|reader| reader.join(&participant))?;
        Ok(true)
    }
}

impl Now {
    fn participant(
        &self,
        topic: &str,
        endpoint: &'static str,
    ) -> Result<Arc<Participant>, RuntimeError> {
        self.participant
            .clone()
            .ok_or_else(|| RuntimeError::Endpoint {
                topic: topic.to_owned(),
                endpoint,
                reason: "there is no DDS participant at the moment".to_owned(),
            })
    }

    /// Each endpoint as it is known above and on the wire.
    fn ids(&self) -> impl Iterator<Item = (EndpointId, EndpointId)> {
        let writers = self.writers().map(|writer| (writer.id(), writer.wire_id()));
        let readers = self.readers().map(|reader| (reader.id(), reader.wire_id()));
        writers.chain(readers)
    }

    fn writers(&self) -> impl Iterator<Item = Arc<DdsWriter>> {
        self.writers.iter().filter_map(Weak::upgrade)
    }

    fn readers(&self) -> impl Iterator<Item = Arc<ReaderSource>> {
        self.readers.iter().filter_map(Weak::upgrade)
    }
}
