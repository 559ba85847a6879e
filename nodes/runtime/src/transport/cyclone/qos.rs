//! QoS policies as Cyclone objects.

use std::ffi::CString;
use std::ptr;

use lattice_cyclone_sys::{
    DDS_DURABILITY_TRANSIENT_LOCAL, DDS_DURABILITY_VOLATILE, DDS_HISTORY_KEEP_LAST,
    DDS_IGNORELOCAL_PARTICIPANT, DDS_RELIABILITY_BEST_EFFORT, DDS_RELIABILITY_RELIABLE,
    dds_create_qos, dds_delete_qos, dds_free, dds_qget_durability, dds_qget_reliability,
    dds_qget_userdata, dds_qos_t, dds_qset_durability, dds_qset_durability_service,
    dds_qset_history, dds_qset_ignorelocal, dds_qset_prop, dds_qset_reliability, dds_qset_userdata,
    dds_qset_writer_data_lifecycle,
};

use crate::transport::qos::{Durability, Qos, Reliability};

/// `max_blocking_time` of a Cyclone writer, ns. [`super::writer`] waits for a full send window instead, without
/// blocking the publisher thread.
const MAX_BLOCKING_NS: i64 = 0;

/// `DDS_LENGTH_UNLIMITED` of the resource limits.
const UNLIMITED: i32 = -1;

/// A QoS object of Cyclone.
pub(super) struct NativeQos(*mut dds_qos_t);

impl NativeQos {
    fn new() -> Self {
        // SAFETY: no arguments; aborts if there is no memory.
        Self(unsafe { dds_create_qos() })
    }

    /// QoS of a participant with its USER_DATA and properties, such as those of DDS Security.
    pub(super) fn of_participant(user_data: &str, properties: &[(CString, CString)]) -> Self {
        let qos = Self::new();
        qos.set_user_data(user_data);
        for (name, value) in properties {
            // SAFETY: `qos` is alive; both strings are NUL-terminated and copied.
            unsafe { dds_qset_prop(qos.0, name.as_ptr(), value.as_ptr()) };
        }
        qos
    }

    /// QoS of a reader or writer with its USER_DATA. Samples are not delivered within the participant.
    pub(super) fn of_endpoint(qos: &Qos, user_data: &str) -> Self {
        let count = |samples: usize| i32::try_from(samples).unwrap_or(i32::MAX).max(1);
        let (depth, kept) = (count(qos.depth), count(qos.kept()));
        let keep_last = DDS_HISTORY_KEEP_LAST;
        let reliability = match qos.reliability {
            Reliability::BestEffort => DDS_RELIABILITY_BEST_EFFORT,
            Reliability::Reliable => DDS_RELIABILITY_RELIABLE,
        };
        let durability = match qos.durability {
            Durability::Volatile => DDS_DURABILITY_VOLATILE,
            Durability::TransientLocal => DDS_DURABILITY_TRANSIENT_LOCAL,
        };
        let native = Self::new();
        native.set_user_data(user_data);
        // SAFETY: all of them set a value of `native`, which is alive.
        unsafe {
            dds_qset_history(native.0, keep_last, depth);
            dds_qset_reliability(native.0, reliability, MAX_BLOCKING_NS);
            dds_qset_durability(native.0, durability);
            // The durability service has its own history, of one sample by default.
            let (samples, instances, each) = (UNLIMITED, UNLIMITED, UNLIMITED);
            dds_qset_durability_service(native.0, 0, keep_last, kept, samples, instances, each);
            dds_qset_writer_data_lifecycle(native.0, false);
            dds_qset_ignorelocal(native.0, DDS_IGNORELOCAL_PARTICIPANT);
        }
        native
    }

    fn set_user_data(&self, text: &str) {
        // SAFETY: `self` is alive; `text.len()` bytes are copied.
        unsafe { dds_qset_userdata(self.0, text.as_ptr().cast(), text.len()) };
    }

    pub(super) fn as_ptr(&self) -> *const dds_qos_t {
        self.0
    }
}

impl Drop for NativeQos {
    fn drop(&mut self) {
        // SAFETY: created by `dds_create_qos`, deleted once.
        unsafe { dds_delete_qos(self.0) };
    }
}

/// USER_DATA of a peer.
///
/// # Safety
///
/// `qos` is null or a Cyclone QoS that is valid during the call.
pub(super) unsafe fn user_data(qos: *const dds_qos_t) -> Vec<u8> {
    let (mut copy, mut bytes) = (ptr::null_mut(), 0);
    // SAFETY: the caller guarantees that `qos` is alive; the returned copy of `size` bytes is owned and
    // freed once.
    unsafe {
        if qos.is_null() || !dds_qget_userdata(qos, &mut copy, &mut bytes) || copy.is_null() {
            return Vec::new();
        }
        let data = std::slice::from_raw_parts(copy.cast::<u8>(), bytes).to_vec();
        dds_free(copy);
        data
    }
}

/// Announced reliability and durability of a peer; `None` if not announced.
///
/// # Safety
///
/// `qos` is null or a Cyclone QoS that is valid during the call.
pub(super) unsafe fn announced(qos: *const dds_qos_t) -> Option<(Reliability, Durability)> {
    if qos.is_null() {
        return None;
    }
    let (mut reliability, mut blocking_ns, mut durability) = (0, 0, 0);
    // SAFETY: the caller guarantees that `qos` is alive; the others are local.
    let known = unsafe {
        dds_qget_reliability(qos, &mut reliability, &mut blocking_ns)
            && dds_qget_durability(qos, &mut durability)
    };
    let reliability = match reliability == DDS_RELIABILITY_RELIABLE {
        true => Reliability::Reliable,
        false => Reliability::BestEffort,
    };
    let durability = match durability == DDS_DURABILITY_VOLATILE {
        true => Durability::Volatile,
        false => Durability::TransientLocal,
    };
    known.then_some((reliability, durability))
}
