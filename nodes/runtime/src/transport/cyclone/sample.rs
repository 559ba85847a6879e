//! Samples in Cyclone's memory.

use std::mem::MaybeUninit;
use std::slice;

use lattice_cyclone_sys::{
    dds_entity_t, dds_instance_handle_t, lattice_identity, lattice_release, lattice_sample,
    lattice_take,
};

use super::entity::check;
use crate::transport::port::{EndpointId, SampleId};

/// A sample taken from a reader.
pub(super) struct Taken(lattice_sample);

// SAFETY: Cyclone counts references atomically; a sample is immutable.
unsafe impl Send for Taken {}

impl Taken {
    /// Bytes of the sample, encapsulation header first.
    pub(super) fn bytes(&self) -> &[u8] {
        // SAFETY: `self` owns a reference to the sample, which has `length` bytes.
        unsafe { slice::from_raw_parts(self.0.bytes, self.0.length) }
    }

    /// Instance handle of its writer.
    pub(super) fn writer(&self) -> dds_instance_handle_t {
        self.0.writer
    }

    /// Sequence number given by its writer; 0 if unknown.
    pub(super) fn number(&self) -> i64 {
        self.0.number
    }

    /// Identity of the request it replies to, if present.
    pub(super) fn related(&self) -> Option<SampleId> {
        let lattice_identity { guid, number } = self.0.related;
        let writer = EndpointId(guid);
        (self.0.has_related).then_some(SampleId { writer, number })
    }
}

impl Drop for Taken {
    fn drop(&mut self) {
        // SAFETY: releases the reference of `self` once.
        unsafe { lattice_release(self.0.blob) };
    }
}

/// Takes the next sample of a reader.
pub(super) fn take(reader: dds_entity_t) -> Option<Taken> {
    let mut sample = MaybeUninit::uninit();
    // SAFETY: space for one sample.
    match check(unsafe { lattice_take(reader, sample.as_mut_ptr()) }) {
        Ok(0) => None,
        // SAFETY: one sample was taken with an owned reference.
        Ok(_) => Some(Taken(unsafe { sample.assume_init() })),
        Err(words) => {
            // Only a deleted reader fails; no more samples follow.
            log::debug!("Cyclone DDS: {words}");
            None
        }
    }
}
