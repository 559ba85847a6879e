//! Owned handles of Cyclone entities, and texts of return codes.

use std::ffi::CStr;

use lattice_cyclone_sys::{dds_delete, dds_entity_t, dds_get_guid, dds_guid_t, dds_strretcode};

use crate::transport::port::EndpointId;

/// A Cyclone entity; dropping it deletes it and its listeners.
#[derive(Debug)]
pub(super) struct Entity(dds_entity_t);

impl Entity {
    /// Takes ownership of a created entity; the error is the text of the return code.
    pub(super) fn new(made: dds_entity_t) -> Result<Self, String> {
        check(made).map(Self)
    }

    /// Entity handle. Cyclone returns an error for a deleted one.
    pub(super) fn handle(&self) -> dds_entity_t {
        self.0
    }

    /// GUID of a participant, reader or writer.
    pub(super) fn id(&self) -> Result<EndpointId, String> {
        let mut guid = dds_guid_t { v: [0; 16] };
        // SAFETY: writes 16 bytes to `guid`, which is valid until the call returns.
        let _ = check(unsafe { dds_get_guid(self.0, &mut guid) })?;
        Ok(endpoint_id(guid))
    }
}

impl Drop for Entity {
    fn drop(&mut self) {
        // SAFETY: takes a handle; a deleted entity gives an error code.
        let code = unsafe { dds_delete(self.0) };
        if let Err(words) = check(code) {
            log::debug!("Cyclone DDS: {words}");
        }
    }
}

pub(super) fn endpoint_id(guid: dds_guid_t) -> EndpointId {
    EndpointId(guid.v)
}

/// Checks a return code: a count or handle, or the text of the error.
pub(super) fn check(code: i32) -> Result<i32, String> {
    if code >= 0 {
        return Ok(code);
    }
    // SAFETY: returns a static string for any number.
    let words = unsafe { CStr::from_ptr(dds_strretcode(code)) };
    Err(words.to_string_lossy().into_owned())
}
