//! Participants rejected by DDS Security. Cyclone reports neither participants without a certificate nor all
//! failed handshakes, so rejection is inferred: a rejected participant announces no endpoint.

use std::collections::BTreeMap;
use std::ffi::{CStr, c_void};
use std::ptr;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use lattice_cyclone_sys::{
    DDS_BUILTIN_TOPIC_DCPSPARTICIPANT, dds_builtintopic_participant_t, dds_create_reader, dds_free,
    dds_qget_prop,
};
use log::Level;

use super::builtin_topic::take_all;
use super::entity::{Entity, endpoint_id};
use super::log::tell;
use crate::sync::lock;
use crate::transport::port::EndpointId;

/// Time for the handshake. A participant without endpoints after it counts as unauthenticated.
const PATIENCE: Duration = Duration::from_secs(10);

/// Limit of tracked participants.
const MAX_PARTICIPANTS: usize = 4096;

/// Cyclone property with the addresses of a participant.
const ADDRESSES: &CStr = c"__NetworkAddresses";

/// GUID prefix (12 bytes), common to a participant and its endpoints.
type Prefix = [u8; 12];

/// Tracks discovered participants and whether each has announced an endpoint.
pub(super) struct UnauthenticatedParticipants {
    participants: Entity,
    ours: Option<Prefix>,
    others: Mutex<BTreeMap<Prefix, Other>>,
}

struct Other {
    since: Instant,
    authenticated: bool,
    addresses: String,
}

impl UnauthenticatedParticipants {
    pub(super) fn watch(participant: &Entity) -> Result<Self, String> {
        let (parent, topic) = (participant.handle(), DDS_BUILTIN_TOPIC_DCPSPARTICIPANT);
        // SAFETY: handles; no QoS and no listener.
        let made = unsafe { dds_create_reader(parent, topic, ptr::null(), ptr::null()) };
        Ok(Self {
            participants: Entity::new(made)?,
            ours: prefix(participant.id()?),
            others: Mutex::default(),
        })
    }

    /// Marks the participant of a discovered endpoint as authenticated.
    pub(super) fn mark_authenticated(&self, endpoint: EndpointId) {
        if let Some(prefix) = prefix(endpoint) {
            note(&mut lock(&self.others), prefix, |other| {
                other.authenticated = true
            });
        }
    }

    /// Number of unauthenticated participants; logs each.
    pub(super) fn count(&self) -> usize {
        let mut others = lock(&self.others);
        take_all(self.participants.handle(), &mut |sample, alive| {
            // SAFETY: this reader returns participants; each is valid during the call.
            let (id, addresses) = unsafe {
                let participant = sample.cast::<dds_builtintopic_participant_t>();
                let Some(participant) = participant.as_ref() else {
                    return;
                };
                (endpoint_id(participant.key), addresses(participant))
            };
            match prefix(id).filter(|prefix| Some(*prefix) != self.ours) {
                Some(prefix) if alive => {
                    note(&mut others, prefix, |other| other.addresses = addresses)
                }
                Some(prefix) => drop(others.remove(&prefix)),
                None => {}
            }
        });
        let out = |other: &&Other| !other.authenticated && other.since.elapsed() >= PATIENCE;
        let out = others.values().filter(out);
        out.inspect(|other| {
            let words =
                "is not authenticated: it has no certificate, or no permissions for this domain";
            tell(
                Level::Warn,
                &format!("the participant at {} {words}", other.addresses),
            );
        })
        .count()
    }
}

fn note(others: &mut BTreeMap<Prefix, Other>, prefix: Prefix, change: impl FnOnce(&mut Other)) {
    if others.len() < MAX_PARTICIPANTS || others.contains_key(&prefix) {
        change(others.entry(prefix).or_insert_with(|| Other {
            since: Instant::now(),
            authenticated: false,
            addresses: String::new(),
        }));
    }
}

fn prefix(id: EndpointId) -> Option<Prefix> {
    id.0.first_chunk().copied()
}

/// # Safety
///
/// The participant is on loan from Cyclone.
unsafe fn addresses(participant: &dds_builtintopic_participant_t) -> String {
    let mut text = ptr::null_mut();
    // SAFETY: the QoS is null or lives as long as the participant; the text is an owned NUL-terminated copy,
    // freed once.
    unsafe {
        if participant.qos.is_null()
            || !dds_qget_prop(participant.qos, ADDRESSES.as_ptr(), &mut text)
        {
            return String::new();
        }
        let addresses = CStr::from_ptr(text).to_string_lossy().into_owned();
        dds_free(text.cast::<c_void>());
        addresses
    }
}
