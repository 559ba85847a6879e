//! Incompatible endpoints of other participants. Cyclone reports none where the types differ.

use std::borrow::Cow;
use std::ffi::{CStr, c_char, c_void};
use std::ptr;
use std::sync::{Arc, Mutex, Weak};

use lattice_cyclone_sys::{
    DDS_BUILTIN_TOPIC_DCPSPUBLICATION, DDS_BUILTIN_TOPIC_DCPSSUBSCRIPTION,
    dds_builtintopic_endpoint_t, dds_create_listener, dds_create_reader, dds_delete_listener,
    dds_entity_t, dds_lset_data_available_arg,
};
use smol::channel::Sender;

use super::builtin_topic::take_all;
use super::endpoint::{Description, Endpoint, Side};
use super::entity::{Entity, endpoint_id};
use super::names::role;
use super::qos::{announced, user_data};
use super::unauthenticated_participants::UnauthenticatedParticipants;
use crate::sync::lock;
use crate::transport::port::{DURABILITY_CONFLICT, EndpointId, PortEvent, RELIABILITY_CONFLICT};
use crate::transport::qos::{Durability, Reliability};
use crate::transport::remote::{Announced, GraphRole, RemotePublisher, announced_hash};

/// Local endpoints, and readers of Cyclone's built-in topics that check remote endpoints against them.
pub(super) struct Discovery {
    // Deleted before the objects that their listeners refer to.
    readers: Mutex<Vec<Entity>>,
    participant: EndpointId,
    ours: Mutex<Vec<Weak<Endpoint>>>,
    events: Sender<PortEvent>,
    unauthenticated_participants: Option<UnauthenticatedParticipants>,
}

/// An endpoint of another participant.
struct Other<'a> {
    id: EndpointId,
    name: &'a CStr,
    type_name: &'a CStr,
    qos: Option<(Reliability, Durability)>,
    user_data: Vec<u8>,
}

impl Other<'_> {
    /// Type and QoS of a subscription; a policy that is not announced has its default of DDS.
    fn announced(&self) -> Option<Announced> {
        let qos = self
            .qos
            .unwrap_or((Reliability::BestEffort, Durability::Volatile));
        let hash = announced_hash(&self.user_data);
        Announced::of(self.type_name.to_str().ok()?, hash.as_deref(), qos)
    }
}

impl Discovery {
    /// `secured`: DDS Security is enabled.
    pub(super) fn start(
        participant: &Entity,
        events: Sender<PortEvent>,
        secured: bool,
    ) -> Result<Arc<Self>, String> {
        let unauthenticated_participants = secured
            .then(|| UnauthenticatedParticipants::watch(participant))
            .transpose()?;
        let this = Arc::new(Self {
            readers: Mutex::default(),
            participant: participant.id()?,
            ours: Mutex::default(),
            events,
            unauthenticated_participants,
        });
        for (topic, listener) in [
            (DDS_BUILTIN_TOPIC_DCPSPUBLICATION, on_writers as Listener),
            (DDS_BUILTIN_TOPIC_DCPSSUBSCRIPTION, on_readers),
        ] {
            let arg = Arc::as_ptr(&this).cast_mut().cast::<c_void>();
            // SAFETY: handles; the listener is created, copied and deleted here; `this` owns the readers and
            // outlives them.
            let made = unsafe {
                let heard = dds_create_listener(ptr::null_mut());
                let _ = dds_lset_data_available_arg(heard, Some(listener), arg, true);
                let made = dds_create_reader(participant.handle(), topic, ptr::null(), heard);
                dds_delete_listener(heard);
                made
            };
            lock(&this.readers).push(Entity::new(made)?);
        }
        Ok(this)
    }

    /// Number of unauthenticated participants.
    pub(super) fn unauthenticated_participants(&self) -> usize {
        self.unauthenticated_participants
            .as_ref()
            .map_or(0, UnauthenticatedParticipants::count)
    }

    /// Checks a local endpoint against all remote endpoints, present and future.
    pub(super) fn announce(&self, participant: &Entity, ours: &Arc<Endpoint>) {
        let mut all = lock(&self.ours);
        all.retain(|ours| ours.strong_count() > 0);
        all.push(Arc::downgrade(ours));
        drop(all);
        let (topic, side) = match ours.description.side {
            Side::Writer => (DDS_BUILTIN_TOPIC_DCPSSUBSCRIPTION, Side::Reader),
            Side::Reader => (DDS_BUILTIN_TOPIC_DCPSPUBLICATION, Side::Writer),
        };
        // SAFETY: handles; a new reader of a built-in topic receives all known endpoints.
        let made =
            unsafe { dds_create_reader(participant.handle(), topic, ptr::null(), ptr::null()) };
        if let Ok(reader) = Entity::new(made) {
            self.take(reader.handle(), &mut |other| {
                self.compare(ours, side, other)
            });
        }
    }

    fn heard(&self, reader: dds_entity_t, side: Side) {
        self.take(reader, &mut |other| {
            match side {
                Side::Writer => self.found(other),
                Side::Reader => self.found_reader(other),
            }
            let all: Vec<_> = lock(&self.ours).iter().filter_map(Weak::upgrade).collect();
            all.iter().for_each(|ours| self.compare(ours, side, other));
        });
    }

    /// Emits the event of a discovered subscription or server.
    fn found_reader(&self, other: &Other<'_>) {
        let name = other.name.to_str().ok();
        if let Some((role, name)) = name.and_then(|name| role(Side::Reader, name)) {
            let announced = match role {
                GraphRole::Subscriber => other.announced(),
                _ => None,
            };
            let _ = self.events.try_send(PortEvent::FoundOther {
                peer: other.id,
                role,
                name: name.to_owned(),
                announced: announced.map(Box::new),
                node: None,
            });
        }
    }

    /// Emits the event of a discovered publisher.
    fn found(&self, other: &Other<'_>) {
        let (Ok(name), Ok(type_name)) = (other.name.to_str(), other.type_name.to_str()) else {
            return;
        };
        // Defaults of DDS where the policy is not announced.
        let qos = other
            .qos
            .unwrap_or((Reliability::Reliable, Durability::Volatile));
        if let Some(found) = RemotePublisher::of((name, type_name), &other.user_data, qos) {
            let (peer, publisher) = (other.id, Box::new(found));
            let node = None;
            let _ = self.events.try_send(PortEvent::Found {
                peer,
                publisher,
                node,
            });
        }
    }

    fn compare(&self, ours: &Endpoint, side: Side, other: &Other<'_>) {
        let description = &ours.description;
        let name = description.dds_name.as_bytes();
        if description.side == side || other.name.to_bytes() != name {
            return;
        }
        if let Some(policy) = conflict(description, other) {
            let (endpoint, peer) = (ours.id(), other.id);
            let event = PortEvent::Incompatible {
                endpoint,
                peer,
                policy,
            };
            let _ = self.events.try_send(event);
        }
    }

    /// Passes new endpoints of other participants to `each`; emits events for removed ones.
    fn take(&self, reader: dds_entity_t, each: &mut dyn FnMut(&Other<'_>)) {
        take_all(reader, &mut |sample, alive| {
            // SAFETY: these readers return endpoints; each is valid during the call.
            unsafe {
                if let Some(endpoint) = sample.cast::<dds_builtintopic_endpoint_t>().as_ref() {
                    self.sort(endpoint, alive, each);
                }
            }
        });
    }

    /// # Safety
    ///
    /// The endpoint is on loan from Cyclone.
    unsafe fn sort(
        &self,
        endpoint: &dds_builtintopic_endpoint_t,
        alive: bool,
        each: &mut dyn FnMut(&Other<'_>),
    ) {
        let id = endpoint_id(endpoint.key);
        if id.same_participant(&self.participant) {
            return;
        }
        if !alive {
            let _ = self.events.try_send(PortEvent::Lost { peer: id });
            return;
        }
        if let Some(unauthenticated_participants) = &self.unauthenticated_participants {
            unauthenticated_participants.mark_authenticated(id);
        }
        // SAFETY: strings and QoS are null or live as long as the endpoint.
        let (name, type_name, qos, user_data) = unsafe {
            let (name, type_name) = (text(endpoint.topic_name), text(endpoint.type_name));
            let user_data = user_data(endpoint.qos);
            (name, type_name, announced(endpoint.qos), user_data)
        };
        each(&Other {
            id,
            name,
            type_name,
            qos,
            user_data,
        });
    }
}

impl Drop for Discovery {
    fn drop(&mut self) {
        // Listeners use the other fields.
        lock(&self.readers).clear();
    }
}

/// First incompatible policy or type of two endpoints on one topic.
fn conflict(ours: &Description, other: &Other<'_>) -> Option<Cow<'static, str>> {
    if other.type_name.to_bytes() != ours.dds_type.as_bytes() {
        let theirs = other.type_name.to_string_lossy();
        return Some(format!("type {theirs}, not {}", ours.dds_type).into());
    }
    let our_qos = (ours.qos.reliability, ours.qos.durability);
    let (offered, requested) = match ours.side {
        Side::Writer => (our_qos, other.qos?),
        Side::Reader => (other.qos?, our_qos),
    };
    if requested.0 == Reliability::Reliable && offered.0 == Reliability::BestEffort {
        Some(RELIABILITY_CONFLICT.into())
    } else if requested.1 == Durability::TransientLocal && offered.1 == Durability::Volatile {
        Some(DURABILITY_CONFLICT.into())
    } else {
        None
    }
}

/// # Safety
///
/// Null, or a NUL-terminated string that is valid for `'a`.
unsafe fn text<'a>(text: *const c_char) -> &'a CStr {
    match text.is_null() {
        true => c"",
        // SAFETY: see above.
        false => unsafe { CStr::from_ptr(text) },
    }
}

type Listener = unsafe extern "C" fn(dds_entity_t, *mut c_void);

/// # Safety
///
/// `this` points to the [`Discovery`] that created the listener.
unsafe extern "C" fn on_writers(reader: dds_entity_t, this: *mut c_void) {
    // SAFETY: see above.
    if let Some(discovery) = unsafe { this.cast::<Discovery>().as_ref() } {
        discovery.heard(reader, Side::Writer);
    }
}

/// # Safety
///
/// Callback for readers, as [`on_writers`] is for writers.
unsafe extern "C" fn on_readers(reader: dds_entity_t, this: *mut c_void) {
    // SAFETY: see above.
    if let Some(discovery) = unsafe { this.cast::<Discovery>().as_ref() } {
        discovery.heard(reader, Side::Reader);
    }
}
