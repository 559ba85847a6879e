//! Participants that security keeps out. Cyclone says nothing of those without a certificate, nor of all
//! whose handshake fails; what they have in common is that they show none of their endpoints.

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

use super::discovery::take_all;
use super::entity::{Entity, endpoint_id};
use super::log::tell;
use crate::port::EndpointId;
use crate::sync::lock;

/// Time for the handshake, after which who shows nothing is a stranger.
const PATIENCE: Duration = Duration::from_secs(10);

/// Participants that are watched, at most.
const MAX_PARTICIPANTS: usize = 4096;

/// Property in which Cyclone gives the addresses of a participant.
const ADDRESSES: &CStr = c"__NetworkAddresses";

/// First twelve bytes of the GUIDs of a participant and its endpoints.
type Prefix = [u8; 12];

/// Watches who comes, and who shows endpoints.
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

    /// An endpoint of a participant is known, so security has let the participant in.
    pub(super) fn mark_authenticated(&self, endpoint: EndpointId) {
        if let Some(prefix) = prefix(endpoint) {
            note(&mut lock(&self.others), prefix, |other| {
                other.authenticated = true
            });
        }
    }

    /// Participants that are kept out; the log names them.
    pub(super) fn count(&self) -> usize {
        let mut others = lock(&self.others);
        take_all(self.participants.handle(), &mut |sample, alive| {
            // SAFETY: the reader is of participants; this one is lent during the call.
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
            let words = "is kept out: it has no certificate or no permissions that hold here";
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
/// The participant is one that Cyclone has lent.
unsafe fn addresses(participant: &dds_builtintopic_participant_t) -> String {
    let mut text = ptr::null_mut();
    // SAFETY: the QoS is null or lives as long as the participant; the text is a copy that ends with 0, is
    // ours, and is freed once.
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
