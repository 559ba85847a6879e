//! Who is matched with whom: the status events of the participant, handed to our endpoints.
//!
//! The participant has one status queue, long enough that no event is lost; the queues of single
//! readers and writers hold four.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, Weak};

use futures::StreamExt;
use rustdds::policy::{Durability, Reliability};
use rustdds::{
    DomainParticipant, DomainParticipantStatusEvent as Event, GUID, QosPolicies, RTPSEntity,
    StatusEvented,
};

use crate::peers::Peers;
use crate::sync::lock;

/// Events of endpoints that are not registered yet, kept at most.
const MAX_EARLY_EVENTS: usize = 1024;

/// Our endpoints by their DDS identity.
pub(crate) struct Endpoints {
    own: GUID,
    inner: Mutex<Inner>,
}

#[derive(Default)]
struct Inner {
    peers: BTreeMap<GUID, Weak<Peers>>,
    early: VecDeque<(GUID, Change)>,
}

#[derive(Clone)]
enum Change {
    Matched(GUID),
    Incompatible(GUID, &'static str),
}

impl Endpoints {
    pub(crate) fn new(participant: &DomainParticipant) -> Self {
        Self {
            own: participant.guid(),
            inner: Mutex::default(),
        }
    }

    /// From now on `peers` hears of everything that happens to the endpoint, and of what did.
    pub(crate) fn register(&self, endpoint: GUID, peers: &Arc<Peers>) {
        let early: Vec<Change> = {
            let mut inner = lock(&self.inner);
            inner.peers.retain(|_, peers| peers.strong_count() > 0);
            inner.peers.insert(endpoint, Arc::downgrade(peers));
            let (mine, others) = std::mem::take(&mut inner.early)
                .into_iter()
                .partition(|(guid, _)| *guid == endpoint);
            inner.early = others;
            VecDeque::into_iter(mine)
                .map(|(_, change)| change)
                .collect()
        };
        for change in early {
            self.apply(peers, change);
        }
    }

    /// Hands events on until the task is dropped.
    pub(crate) async fn watch(self: Arc<Self>, participant: DomainParticipant) {
        let listener = participant.status_listener();
        drop(participant);
        let mut events = listener.as_async_status_stream();
        while let Some(event) = events.next().await {
            match event {
                Event::RemoteReaderMatched {
                    local_writer,
                    remote_reader,
                } => self.change(local_writer, Change::Matched(remote_reader)),
                Event::RemoteWriterMatched {
                    local_reader,
                    remote_writer,
                } => self.change(local_reader, Change::Matched(remote_writer)),
                Event::RemoteReaderQosIncompatible {
                    local_writer,
                    remote_reader,
                    requested_qos,
                    offered_qos,
                } => {
                    let policy = incompatible_policy(&offered_qos, &requested_qos);
                    self.change(local_writer, Change::Incompatible(remote_reader, policy));
                }
                Event::RemoteWriterQosIncompatible {
                    local_reader,
                    remote_writer,
                    requested_qos,
                    offered_qos,
                } => {
                    let policy = incompatible_policy(&offered_qos, &requested_qos);
                    self.change(local_reader, Change::Incompatible(remote_writer, policy));
                }
                Event::ReaderLost { guid, .. } | Event::WriterLost { guid, .. } => {
                    self.lost(|peer| *peer == guid);
                }
                Event::ParticipantLost { id, .. } if id != self.own.prefix => {
                    self.lost(|peer| peer.prefix == id);
                }
                _ => {}
            }
        }
    }

    fn change(&self, endpoint: GUID, change: Change) {
        let peers = {
            let mut inner = lock(&self.inner);
            match inner.peers.get(&endpoint) {
                Some(peers) => peers.upgrade(),
                // Discovery's own endpoints are nobody's business here.
                None if !endpoint.entity_id.kind().is_user_defined() => None,
                None => {
                    if inner.early.len() >= MAX_EARLY_EVENTS {
                        inner.early.pop_front();
                    }
                    inner.early.push_back((endpoint, change.clone()));
                    None
                }
            }
        };
        if let Some(peers) = peers {
            self.apply(&peers, change);
        }
    }

    fn lost(&self, gone: impl Fn(&GUID) -> bool) {
        let all: Vec<Arc<Peers>> = {
            let mut inner = lock(&self.inner);
            inner.early.retain(|(_, change)| match change {
                Change::Matched(peer) | Change::Incompatible(peer, _) => !gone(peer),
            });
            inner.peers.values().filter_map(Weak::upgrade).collect()
        };
        for peers in all {
            peers.remove(&gone);
        }
    }

    fn apply(&self, peers: &Peers, change: Change) {
        match change {
            Change::Matched(peer) if peer.prefix == self.own.prefix && !peers.hears_own() => {
                log::debug!("{}: matched inside the participant", peers.topic());
            }
            Change::Matched(peer) => peers.add(peer),
            Change::Incompatible(peer, _) if peer.prefix == self.own.prefix => {}
            Change::Incompatible(peer, policy) => peers.incompatible(peer, policy),
        }
    }
}

/// First policy in which an offer is less than what is requested, in words for the operator.
fn incompatible_policy(offered: &QosPolicies, requested: &QosPolicies) -> &'static str {
    let reliable =
        |qos: &QosPolicies| matches!(qos.reliability(), Some(Reliability::Reliable { .. }));
    let rank = |qos: &QosPolicies| qos.durability().unwrap_or(Durability::Volatile);
    if reliable(requested) && !reliable(offered) {
        "reliability (the subscription asks for reliable, the publisher offers best_effort)"
    } else if rank(requested) > rank(offered) {
        "durability (the subscription asks for transient_local, the publisher offers volatile)"
    } else if requested.deadline() != offered.deadline() {
        "deadline"
    } else {
        "liveliness, ownership or another policy"
    }
}
