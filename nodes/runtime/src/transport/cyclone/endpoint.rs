//! A local endpoint: its description, and its peers as reported by Cyclone's listeners.

use std::collections::BTreeMap;
use std::ffi::c_void;
use std::ptr;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex};

use lattice_cyclone_sys::{
    dds_builtintopic_endpoint_t, dds_builtintopic_free_endpoint, dds_create_listener,
    dds_delete_listener, dds_entity_t, dds_get_matched_publication_data,
    dds_get_matched_publications, dds_get_matched_subscription_data, dds_get_matched_subscriptions,
    dds_instance_handle_t, dds_lset_data_available_arg, dds_lset_publication_matched_arg,
    dds_lset_subscription_matched_arg, dds_publication_matched_status_t, dds_set_listener,
    dds_subscription_matched_status_t, lattice_on_reader_left,
};
use smol::channel::Sender;

use super::entity::{Entity, check, endpoint_id};
use super::sample::{Taken, take};
use crate::sync::lock;
use crate::transport::arrivals::Arrivals;
use crate::transport::gaps::Gaps;
use crate::transport::port::{EndpointId, PortEvent};
use crate::transport::qos::Qos;

/// Limit of peers that matched before the listener was set.
const MAX_FIRST_PEERS: usize = 4096;

/// Side of a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Writer,
    Reader,
}

/// Announced description of an endpoint.
#[derive(Clone, Debug)]
pub(super) struct Description {
    pub side: Side,
    pub dds_name: String,
    pub dds_type: String,
    pub qos: Qos,
}

/// A local reader or writer. Its listeners refer to it, so it outlives their entity.
pub(super) struct Endpoint {
    id: EndpointId,
    pub description: Description,
    events: Sender<PortEvent>,
    /// Peers by their Cyclone instance handles.
    peers: Mutex<BTreeMap<dds_instance_handle_t, EndpointId>>,
    arrivals: Arrivals<Taken>,
    /// Sequence numbers of received samples.
    gaps: Mutex<Gaps>,
    /// Samples left unacknowledged by readers that have left.
    unacknowledged: AtomicU64,
}

/// Function of Cyclone that describes a matched peer.
type Describe =
    unsafe extern "C" fn(dds_entity_t, dds_instance_handle_t) -> *mut dds_builtintopic_endpoint_t;

const READERS: Describe = dds_get_matched_subscription_data;
const WRITERS: Describe = dds_get_matched_publication_data;

/// Function of Cyclone that lists matched peers.
type List = unsafe extern "C" fn(dds_entity_t, *mut dds_instance_handle_t, usize) -> i32;

impl Endpoint {
    /// Reports the peers and samples of the entity, including peers that are present already.
    pub(super) fn watch(
        entity: &Entity,
        description: Description,
        events: Sender<PortEvent>,
    ) -> Result<Arc<Self>, String> {
        let side = description.side;
        let this = Arc::new(Self {
            id: entity.id()?,
            arrivals: Arrivals::new(description.qos.depth),
            description,
            events,
            peers: Mutex::default(),
            gaps: Mutex::default(),
            unacknowledged: AtomicU64::new(0),
        });
        this.listen(entity)?;
        let (list, describe) = match side {
            Side::Writer => (dds_get_matched_subscriptions as List, READERS),
            Side::Reader => (dds_get_matched_publications as List, WRITERS),
        };
        this.add_first(entity, list, describe);
        if side == Side::Reader {
            this.take_from(entity.handle());
        }
        Ok(this)
    }

    pub(super) fn id(&self) -> EndpointId {
        self.id
    }

    /// Received samples of a reader.
    pub(super) fn arrivals(&self) -> &Arrivals<Taken> {
        &self.arrivals
    }

    /// Samples of a writer left unacknowledged by readers that have left.
    pub(super) fn unacknowledged(&self) -> u64 {
        self.unacknowledged.load(Relaxed)
    }

    /// GUID of a sample's writer; `None` if the writer has left.
    pub(super) fn writer(
        &self,
        reader: dds_entity_t,
        handle: dds_instance_handle_t,
    ) -> Option<EndpointId> {
        let known = lock(&self.peers).get(&handle).copied();
        known.or_else(|| guid(reader, handle, WRITERS))
    }

    fn take_from(&self, reader: dds_entity_t) {
        let mut gaps = lock(&self.gaps);
        self.arrivals.take_from(|| {
            let sample = take(reader)?;
            let (handle, number) = (sample.writer(), sample.number());
            if let Some(writer) = self.writer(reader, handle).filter(|_| number > 0) {
                let missing = gaps.note(writer, handle, number);
                let losses = self.arrivals.losses();
                losses.on_network.fetch_add(missing, Relaxed);
            }
            Some(sample)
        });
    }

    fn listen(self: &Arc<Self>, entity: &Entity) -> Result<(), String> {
        let this = Arc::as_ptr(self).cast_mut().cast::<c_void>();
        // SAFETY: the listener is created, copied into the entity and deleted here; the owner of the entity
        // holds `self`, which outlives it.
        let code = unsafe {
            let listener = dds_create_listener(ptr::null_mut());
            let _ = match self.description.side {
                Side::Writer => {
                    lattice_on_reader_left(Some(on_reader_left));
                    dds_lset_publication_matched_arg(listener, Some(on_reader), this, true)
                }
                Side::Reader => {
                    let _ = dds_lset_data_available_arg(listener, Some(on_data), this, true);
                    dds_lset_subscription_matched_arg(listener, Some(on_writer), this, true)
                }
            };
            let code = dds_set_listener(entity.handle(), listener);
            dds_delete_listener(listener);
            code
        };
        check(code).map(drop)
    }

    fn add_first(&self, entity: &Entity, list: List, describe: Describe) {
        let mut handles = [0; MAX_FIRST_PEERS];
        // SAFETY: space for the stated number of handles.
        let found = unsafe { list(entity.handle(), handles.as_mut_ptr(), handles.len()) };
        let found = usize::try_from(found).unwrap_or(0);
        for handle in handles.iter().take(found) {
            self.matched(entity.handle(), *handle, 1, describe);
        }
    }

    fn matched(
        &self,
        entity: dds_entity_t,
        handle: dds_instance_handle_t,
        change: i32,
        describe: Describe,
    ) {
        let event = if change < 0 {
            let gone = lock(&self.peers).remove(&handle);
            gone.map(|peer| PortEvent::Lost { peer })
        } else {
            guid(entity, handle, describe).map(|peer| {
                let _ = lock(&self.peers).insert(handle, peer);
                let endpoint = self.id;
                PortEvent::Matched { endpoint, peer }
            })
        };
        if let Some(event) = event {
            // The receiver may be gone at shutdown.
            let _ = self.events.try_send(event);
        }
    }
}

/// GUID of a matched peer; `None` if it has left.
fn guid(
    entity: dds_entity_t,
    handle: dds_instance_handle_t,
    describe: Describe,
) -> Option<EndpointId> {
    // SAFETY: handles; the returned data are owned and freed once.
    unsafe {
        let found = describe(entity, handle);
        let id = found.as_ref().map(|found| endpoint_id(found.key));
        if !found.is_null() {
            dds_builtintopic_free_endpoint(found);
        }
        id
    }
}

/// # Safety
///
/// `this` points to the [`Endpoint`] that created the listener.
unsafe extern "C" fn on_reader(
    writer: dds_entity_t,
    status: dds_publication_matched_status_t,
    this: *mut c_void,
) {
    // SAFETY: see above.
    if let Some(endpoint) = unsafe { this.cast::<Endpoint>().as_ref() } {
        let (handle, change) = (status.last_subscription_handle, status.current_count_change);
        endpoint.matched(writer, handle, change, READERS);
    }
}

/// # Safety
///
/// As for [`on_reader`].
unsafe extern "C" fn on_writer(
    reader: dds_entity_t,
    status: dds_subscription_matched_status_t,
    this: *mut c_void,
) {
    // SAFETY: see above.
    if let Some(endpoint) = unsafe { this.cast::<Endpoint>().as_ref() } {
        let (handle, change) = (status.last_publication_handle, status.current_count_change);
        endpoint.matched(reader, handle, change, WRITERS);
    }
}

/// # Safety
///
/// As for [`on_reader`].
unsafe extern "C" fn on_reader_left(this: *mut c_void, unacknowledged: u64) {
    // SAFETY: see above.
    if let Some(endpoint) = unsafe { this.cast::<Endpoint>().as_ref() } {
        endpoint.unacknowledged.fetch_add(unacknowledged, Relaxed);
    }
}

/// # Safety
///
/// As for [`on_reader`].
unsafe extern "C" fn on_data(reader: dds_entity_t, this: *mut c_void) {
    // SAFETY: see above.
    if let Some(endpoint) = unsafe { this.cast::<Endpoint>().as_ref() } {
        endpoint.take_from(reader);
    }
}
