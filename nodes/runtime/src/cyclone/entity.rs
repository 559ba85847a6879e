//! Handles of Cyclone's entities, which end with their owner, and return codes in words.

use std::ffi::CStr;

use lattice_cyclone_sys::{dds_delete, dds_entity_t, dds_get_guid, dds_guid_t, dds_strretcode};

use crate::port::EndpointId;

/// An entity of Cyclone; dropping it deletes it, after which no listener of it runs.
#[derive(Debug)]
pub(super) struct Entity(dds_entity_t);

impl Entity {
    /// Takes over what a function of Cyclone has made; the error is its return code in words.
    pub(super) fn new(made: dds_entity_t) -> Result<Self, String> {
        check(made).map(Self)
    }

    /// The handle. Used after the deletion, it is an error of Cyclone's and no more.
    pub(super) fn handle(&self) -> dds_entity_t {
        self.0
    }

    /// GUID of a participant, reader or writer.
    pub(super) fn id(&self) -> Result<EndpointId, String> {
        let mut guid = dds_guid_t { v: [0; 16] };
        // SAFETY: writes 16 bytes to `guid`, which lives until the call returns.
        let _ = check(unsafe { dds_get_guid(self.0, &mut guid) })?;
        Ok(endpoint_id(guid))
    }
}

impl Drop for Entity {
    fn drop(&mut self) {
        // SAFETY: takes a handle; an entity that is gone already is an error code.
        let code = unsafe { dds_delete(self.0) };
        if let Err(words) = check(code) {
            log::debug!("Cyclone DDS: {words}");
        }
    }
}

pub(super) fn endpoint_id(guid: dds_guid_t) -> EndpointId {
    EndpointId(guid.v)
}

/// A return code: a count or handle, or an error in Cyclone's words.
pub(super) fn check(code: i32) -> Result<i32, String> {
    if code >= 0 {
        return Ok(code);
    }
    // SAFETY: gives a string of Cyclone's own that is never freed, for any number.
    let words = unsafe { CStr::from_ptr(dds_strretcode(code)) };
    Err(words.to_string_lossy().into_owned())
}
