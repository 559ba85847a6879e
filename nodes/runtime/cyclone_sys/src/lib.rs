//! Functions of Eclipse Cyclone DDS 11.0 used by the runtime, and topics of serialized bytes (`c/blob.h`).
//!
//! Written by hand; `c/blob.c` asserts sizes, offsets and constants. The functions have the names of Cyclone's headers
//! and are documented there.

#![allow(non_camel_case_types)]
// Names and meanings are Cyclone's.
#![allow(missing_docs)]

use std::ffi::{c_char, c_int, c_void};
use std::marker::{PhantomData, PhantomPinned};

pub type dds_entity_t = i32;
pub type dds_return_t = i32;
pub type dds_instance_handle_t = u64;
/// Nanoseconds.
pub type dds_duration_t = i64;

macro_rules! opaque {
    ($($name:ident),*) => {$(
        #[repr(C)]
        pub struct $name {
            _data: [u8; 0],
            _marker: PhantomData<(*mut u8, PhantomPinned)>,
        }
    )*};
}

opaque!(dds_qos_t, dds_listener_t, ddsi_serdata);

/// Identity of a participant, reader or writer.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct dds_guid_t {
    pub v: [u8; 16],
}

#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct dds_sample_info_t {
    pub sample_state: u32,
    pub view_state: u32,
    pub instance_state: u32,
    pub valid_data: bool,
    pub source_timestamp: i64,
    pub instance_handle: dds_instance_handle_t,
    pub publication_handle: dds_instance_handle_t,
    pub disposed_generation_count: u32,
    pub no_writers_generation_count: u32,
    pub sample_rank: u32,
    pub generation_rank: u32,
    pub absolute_generation_rank: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct dds_builtintopic_participant_t {
    pub key: dds_guid_t,
    pub qos: *mut dds_qos_t,
}

#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct dds_builtintopic_endpoint_t {
    pub key: dds_guid_t,
    pub participant_key: dds_guid_t,
    pub participant_instance_handle: dds_instance_handle_t,
    pub topic_name: *mut c_char,
    pub type_name: *mut c_char,
    pub qos: *mut dds_qos_t,
}

#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct dds_publication_matched_status_t {
    pub total_count: u32,
    pub total_count_change: i32,
    pub current_count: u32,
    pub current_count_change: i32,
    pub last_subscription_handle: dds_instance_handle_t,
}

#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct dds_subscription_matched_status_t {
    pub total_count: u32,
    pub total_count_change: i32,
    pub current_count: u32,
    pub current_count_change: i32,
    pub last_publication_handle: dds_instance_handle_t,
}

#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct dds_log_data_t {
    pub priority: u32,
    pub domid: u32,
    pub file: *const c_char,
    pub line: u32,
    pub function: *const c_char,
    pub message: *const c_char,
    pub size: usize,
    pub hdrsize: usize,
}

/// Identity of a sample: the GUID of its writer, or the endpoint named instead, and its number.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct lattice_identity {
    pub guid: [u8; 16],
    pub number: i64,
}

/// A taken sample. Its bytes, encapsulation header first, are valid until [`lattice_release`].
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct lattice_sample {
    pub blob: *mut ddsi_serdata,
    pub bytes: *const u8,
    pub length: usize,
    pub writer: dds_instance_handle_t,
    /// 0: unknown, as within a process.
    pub number: i64,
    pub has_related: bool,
    pub related: lattice_identity,
}

const _: () = {
    assert!(size_of::<dds_sample_info_t>() == 64);
    assert!(size_of::<dds_builtintopic_endpoint_t>() == 64);
    assert!(size_of::<dds_publication_matched_status_t>() == 24);
    assert!(size_of::<dds_subscription_matched_status_t>() == 24);
    assert!(size_of::<lattice_sample>() == 72);
};

pub const DDS_RETCODE_TIMEOUT: dds_return_t = -10;
pub const DDS_ALIVE_INSTANCE_STATE: u32 = 16;
pub const DDS_ANY_STATE: u32 = 127;
pub const DDS_BUILTIN_TOPIC_DCPSPARTICIPANT: dds_entity_t = 0x7fff_0001;
pub const DDS_BUILTIN_TOPIC_DCPSPUBLICATION: dds_entity_t = 0x7fff_0003;
pub const DDS_BUILTIN_TOPIC_DCPSSUBSCRIPTION: dds_entity_t = 0x7fff_0004;
pub const DDS_LC_FATAL: u32 = 1;
pub const DDS_LC_ERROR: u32 = 2;
pub const DDS_LC_WARNING: u32 = 4;
pub const DDS_DURABILITY_VOLATILE: c_int = 0;
pub const DDS_DURABILITY_TRANSIENT_LOCAL: c_int = 1;
pub const DDS_HISTORY_KEEP_LAST: c_int = 0;
pub const DDS_RELIABILITY_BEST_EFFORT: c_int = 0;
pub const DDS_RELIABILITY_RELIABLE: c_int = 1;
pub const DDS_IGNORELOCAL_PARTICIPANT: c_int = 1;

pub type dds_on_data_available_fn = Option<unsafe extern "C" fn(dds_entity_t, *mut c_void)>;
pub type dds_on_publication_matched_fn =
    Option<unsafe extern "C" fn(dds_entity_t, dds_publication_matched_status_t, *mut c_void)>;
pub type dds_on_subscription_matched_fn =
    Option<unsafe extern "C" fn(dds_entity_t, dds_subscription_matched_status_t, *mut c_void)>;
pub type dds_log_write_fn_t = Option<unsafe extern "C" fn(*mut c_void, *const dds_log_data_t)>;

unsafe extern "C" {
    pub fn lattice_topic(
        participant: dds_entity_t,
        name: *const c_char,
        type_name: *const c_char,
    ) -> dds_entity_t;
    pub fn lattice_write(
        writer: dds_entity_t,
        body: *const u8,
        length: usize,
        related: *const lattice_identity,
    ) -> dds_return_t;
    pub fn lattice_writer(
        participant: dds_entity_t,
        topic: dds_entity_t,
        qos: *const dds_qos_t,
        keep: bool,
    ) -> dds_entity_t;
    pub fn lattice_is_full(writer: dds_entity_t, length: usize, most: usize) -> bool;
    pub fn lattice_unacknowledged(writer: dds_entity_t) -> u64;
    pub fn lattice_is_known_to(reader: dds_entity_t, writer: *const u8) -> bool;
    pub fn lattice_on_reader_left(callback: Option<unsafe extern "C" fn(*mut c_void, u64)>);
    pub fn lattice_take(reader: dds_entity_t, sample: *mut lattice_sample) -> dds_return_t;
    pub fn lattice_release(blob: *mut ddsi_serdata);

    pub fn dds_create_domain(domain: u32, config: *const c_char) -> dds_entity_t;
    pub fn dds_create_participant(
        domain: u32,
        qos: *const dds_qos_t,
        listener: *const dds_listener_t,
    ) -> dds_entity_t;
    pub fn dds_create_reader(
        parent: dds_entity_t,
        topic: dds_entity_t,
        qos: *const dds_qos_t,
        listener: *const dds_listener_t,
    ) -> dds_entity_t;
    pub fn dds_delete(entity: dds_entity_t) -> dds_return_t;
    pub fn dds_get_guid(entity: dds_entity_t, guid: *mut dds_guid_t) -> dds_return_t;
    pub fn dds_strretcode(code: dds_return_t) -> *const c_char;
    pub fn dds_free(memory: *mut c_void);
    pub fn dds_set_log_sink(callback: dds_log_write_fn_t, argument: *mut c_void);

    pub fn dds_take_mask(
        reader: dds_entity_t,
        samples: *mut *mut c_void,
        infos: *mut dds_sample_info_t,
        room: usize,
        most: u32,
        mask: u32,
    ) -> dds_return_t;
    pub fn dds_return_loan(
        entity: dds_entity_t,
        samples: *mut *mut c_void,
        count: i32,
    ) -> dds_return_t;
    pub fn dds_wait_for_acks(writer: dds_entity_t, patience_ns: dds_duration_t) -> dds_return_t;

    pub fn dds_get_matched_publications(
        reader: dds_entity_t,
        handles: *mut dds_instance_handle_t,
        room: usize,
    ) -> dds_return_t;
    pub fn dds_get_matched_subscriptions(
        writer: dds_entity_t,
        handles: *mut dds_instance_handle_t,
        room: usize,
    ) -> dds_return_t;
    pub fn dds_get_matched_publication_data(
        reader: dds_entity_t,
        handle: dds_instance_handle_t,
    ) -> *mut dds_builtintopic_endpoint_t;
    pub fn dds_get_matched_subscription_data(
        writer: dds_entity_t,
        handle: dds_instance_handle_t,
    ) -> *mut dds_builtintopic_endpoint_t;
    pub fn dds_builtintopic_free_endpoint(endpoint: *mut dds_builtintopic_endpoint_t);

    pub fn dds_create_listener(argument: *mut c_void) -> *mut dds_listener_t;
    pub fn dds_delete_listener(listener: *mut dds_listener_t);
    pub fn dds_set_listener(entity: dds_entity_t, listener: *const dds_listener_t) -> dds_return_t;
    pub fn dds_lset_data_available_arg(
        listener: *mut dds_listener_t,
        callback: dds_on_data_available_fn,
        argument: *mut c_void,
        reset_on_invoke: bool,
    ) -> dds_return_t;
    pub fn dds_lset_publication_matched_arg(
        listener: *mut dds_listener_t,
        callback: dds_on_publication_matched_fn,
        argument: *mut c_void,
        reset_on_invoke: bool,
    ) -> dds_return_t;
    pub fn dds_lset_subscription_matched_arg(
        listener: *mut dds_listener_t,
        callback: dds_on_subscription_matched_fn,
        argument: *mut c_void,
        reset_on_invoke: bool,
    ) -> dds_return_t;

    pub fn dds_create_qos() -> *mut dds_qos_t;
    pub fn dds_delete_qos(qos: *mut dds_qos_t);
    pub fn dds_qset_durability(qos: *mut dds_qos_t, kind: c_int);
    pub fn dds_qset_durability_service(
        qos: *mut dds_qos_t,
        cleanup_delay_ns: dds_duration_t,
        history: c_int,
        depth: i32,
        max_samples: i32,
        max_instances: i32,
        max_samples_per_instance: i32,
    );
    pub fn dds_qset_history(qos: *mut dds_qos_t, kind: c_int, depth: i32);
    pub fn dds_qset_ignorelocal(qos: *mut dds_qos_t, kind: c_int);
    pub fn dds_qset_prop(qos: *mut dds_qos_t, name: *const c_char, value: *const c_char);
    pub fn dds_qset_reliability(qos: *mut dds_qos_t, kind: c_int, max_blocking_ns: dds_duration_t);
    pub fn dds_qset_userdata(qos: *mut dds_qos_t, value: *const c_void, length: usize);
    pub fn dds_qset_writer_data_lifecycle(qos: *mut dds_qos_t, autodispose: bool);
    pub fn dds_qget_durability(qos: *const dds_qos_t, kind: *mut c_int) -> bool;
    pub fn dds_qget_prop(
        qos: *const dds_qos_t,
        name: *const c_char,
        value: *mut *mut c_char,
    ) -> bool;
    pub fn dds_qget_reliability(
        qos: *const dds_qos_t,
        kind: *mut c_int,
        max_blocking_ns: *mut dds_duration_t,
    ) -> bool;
    pub fn dds_qget_userdata(
        qos: *const dds_qos_t,
        value: *mut *mut c_void,
        length: *mut usize,
    ) -> bool;
}
