//! Samples as Cyclone holds them.

use std::mem::MaybeUninit;
use std::slice;

use lattice_cyclone_sys::{
    dds_entity_t, dds_instance_handle_t, lattice_identity, lattice_release, lattice_sample,
    lattice_take,
};

use super::entity::check;
use crate::port::{EndpointId, SampleId};

/// A sample that was taken out of a reader.
pub(super) struct Taken(lattice_sample);

// SAFETY: Cyclone counts references atomically and never changes a sample that is made.
unsafe impl Send for Taken {}

impl Taken {
    /// Its bytes, encapsulation header first.
    pub(super) fn bytes(&self) -> &[u8] {
        // SAFETY: `self` holds a reference to the sample, which has so many bytes there.
        unsafe { slice::from_raw_parts(self.0.bytes, self.0.length) }
    }

    /// Handle of its writer.
    pub(super) fn writer(&self) -> dds_instance_handle_t {
        self.0.writer
    }

    /// The number that its writer gave it; 0 where that is not known.
    pub(super) fn number(&self) -> i64 {
        self.0.number
    }

    /// The request that it answers, where the sender said so.
    pub(super) fn related(&self) -> Option<SampleId> {
        let lattice_identity { guid, number } = self.0.related;
        let writer = EndpointId(guid);
        (self.0.has_related).then_some(SampleId { writer, number })
    }
}

impl Drop for Taken {
    fn drop(&mut self) {
        // SAFETY: gives back the reference that `self` holds, once.
        unsafe { lattice_release(self.0.blob) };
    }
}

/// The next sample of a reader.
pub(super) fn take(reader: dds_entity_t) -> Option<Taken> {
    let mut sample = MaybeUninit::uninit();
    // SAFETY: room for one sample.
    match check(unsafe { lattice_take(reader, sample.as_mut_ptr()) }) {
        Ok(0) => None,
        // SAFETY: one was taken, and the reference is ours.
        Ok(_) => Some(Taken(unsafe { sample.assume_init() })),
        Err(words) => {
            // Only a reader that is gone fails; there will be no more samples.
            log::debug!("Cyclone DDS: {words}");
            None
        }
    }
}
