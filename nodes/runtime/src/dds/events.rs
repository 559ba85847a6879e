//! Status events of the participant, as events of the port.
//!
//! The participant has one status queue, long enough that no event is lost; the queues of single
//! readers and writers hold four.

use rustdds::policy::{Durability, Reliability};
use rustdds::{DomainParticipantStatusEvent as Event, GUID, QosPolicies};

use super::endpoint_id;
use super::probe::Probes;
use crate::port::{EndpointId, PortEvent};

/// The event as one of the port, if it is about peers outside the participant `own`; matches of probes
/// go to `probes`.
pub(super) fn port_event(
    event: Event,
    own: GUID,
    probes: &Probes,
    known_id: impl FnOnce(EndpointId) -> EndpointId,
) -> Option<PortEvent> {
    let (endpoint, peer, policy) = match event {
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
        probes.matched(endpoint);
        return None;
    }
    if !endpoint.entity_id.kind().is_user_defined() {
        return None;
    }
    let (endpoint, peer) = (known_id(endpoint_id(endpoint)), endpoint_id(peer));
    Some(match policy {
        None => PortEvent::Matched { endpoint, peer },
        Some(policy) => PortEvent::Incompatible {
            endpoint,
            peer,
            policy,
        },
    })
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
