//! Status events of the participant, as events of the port.
//!
//! The participant has one status queue, long enough that no event is lost; the queues of single
//! readers and writers hold four.

use std::borrow::Cow;
use std::sync::{Arc, Mutex};

use rustdds::policy::{Durability, Reliability};
use rustdds::{DomainParticipantStatusEvent as Event, EndpointDescription, GUID, QosPolicies};

use super::endpoint_id;
use super::lives::Lives;
use super::probe::Probes;
use crate::port::{DURABILITY_CONFLICT, PortEvent, RELIABILITY_CONFLICT};
use crate::qos;
use crate::remote::RemotePublisher;
use crate::sync::lock;

/// Translates the events of one participant.
pub(super) struct Events {
    own: GUID,
    pub probes: Arc<Probes>,
    /// The endpoint that was found last, with its type: its matches follow.
    found: Mutex<Option<(GUID, String)>>,
}

impl Events {
    /// Of this participant.
    pub(super) fn of(own: GUID) -> Self {
        Self {
            own,
            probes: Arc::default(),
            found: Mutex::default(),
        }
    }

    /// The event as one of the port, if it is about peers outside the participant; matches of probes
    /// go to them.
    pub(super) fn translate(&self, event: Event, lives: &Lives) -> Option<PortEvent> {
        let own = self.own;
        let (endpoint, peer, policy) = match event {
            Event::ReaderDetected { reader: found } => {
                let dds_name = found.topic_name;
                lock(&self.found).replace((found.guid, found.type_name));
                let peer = endpoint_id(found.guid);
                let is_other = found.guid.prefix != own.prefix;
                return is_other.then_some(PortEvent::FoundReader { peer, dds_name });
            }
            Event::WriterDetected { writer: found } => {
                let publisher = (found.guid.prefix != own.prefix)
                    .then(|| remote_publisher(&found))
                    .flatten();
                let peer = endpoint_id(found.guid);
                lock(&self.found).replace((found.guid, found.type_name));
                return Some(PortEvent::Found {
                    peer,
                    publisher: Box::new(publisher?),
                });
            }
            Event::RemoteReaderMatched {
                local_writer,
                remote_reader,
            } => (local_writer, remote_reader, None),
            Event::RemoteWriterMatched {
                local_reader,
                remote_writer,
            } => (local_reader, remote_writer, None),
            Event::RemoteReaderQosIncompatible {
                local_writer,
                remote_reader,
                requested_qos,
                offered_qos,
            } => {
                let policy = incompatible_policy(&offered_qos, &requested_qos);
                (local_writer, remote_reader, Some(policy))
            }
            Event::RemoteWriterQosIncompatible {
                local_reader,
                remote_writer,
                requested_qos,
                offered_qos,
            } => {
                let policy = incompatible_policy(&offered_qos, &requested_qos);
                (local_reader, remote_writer, Some(policy))
            }
            Event::ReaderLost { guid, .. } | Event::WriterLost { guid, .. } => {
                let peer = endpoint_id(guid);
                return Some(PortEvent::Lost { peer });
            }
            Event::ParticipantLost { id, .. } if id != own.prefix => {
                let any = endpoint_id(GUID::new(id, own.entity_id));
                return Some(PortEvent::ParticipantLost { any });
            }
            _ => return None,
        };
        // Nothing is delivered inside a participant, and discovery has endpoints of its own.
        if peer.prefix == own.prefix {
            self.probes.matched(endpoint);
            return None;
        }
        if !endpoint.entity_id.kind().is_user_defined() {
            return None;
        }
        let found = lock(&self.found).take().filter(|(guid, _)| *guid == peer);
        let (endpoint, peer) = (endpoint_id(endpoint), endpoint_id(peer));
        let other_type = found
            .as_ref()
            .and_then(|(_, theirs)| lives.other_type(endpoint, peer, theirs));
        *lock(&self.found) = found;
        let endpoint = lives.known_id(endpoint);
        Some(
            match policy.map(Cow::Borrowed).or(other_type.map(Cow::Owned)) {
                None => PortEvent::Matched { endpoint, peer },
                Some(policy) => PortEvent::Incompatible {
                    endpoint,
                    peer,
                    policy,
                },
            },
        )
    }
}

/// The publisher of a writer, with what is the default of DDS where it does not say.
fn remote_publisher(writer: &EndpointDescription) -> Option<RemotePublisher> {
    let reliable = matches!(writer.qos.reliability(), Some(Reliability::Reliable { .. }));
    let reliability = match reliable {
        true => qos::Reliability::Reliable,
        false => qos::Reliability::BestEffort,
    };
    let durability = match writer.qos.durability() {
        None | Some(Durability::Volatile) => qos::Durability::Volatile,
        Some(_) => qos::Durability::TransientLocal,
    };
    let name = (&*writer.topic_name, &*writer.type_name);
    RemotePublisher::of(name, &writer.user_data, (reliability, durability))
}

/// First policy in which an offer is less than what is requested, in words for the operator.
fn incompatible_policy(offered: &QosPolicies, requested: &QosPolicies) -> &'static str {
    let reliable =
        |qos: &QosPolicies| matches!(qos.reliability(), Some(Reliability::Reliable { .. }));
    let rank = |qos: &QosPolicies| qos.durability().unwrap_or(Durability::Volatile);
    if reliable(requested) && !reliable(offered) {
        RELIABILITY_CONFLICT
    } else if rank(requested) > rank(offered) {
        DURABILITY_CONFLICT
    } else if requested.deadline() != offered.deadline() {
        "DEADLINE_QOS_POLICY"
    } else {
        "liveliness, ownership or another policy"
    }
}
