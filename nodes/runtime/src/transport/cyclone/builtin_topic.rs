//! Samples of the built-in topics of Cyclone.

use std::ffi::c_void;
use std::mem::MaybeUninit;
use std::ptr;

use lattice_cyclone_sys::{
    DDS_ALIVE_INSTANCE_STATE, DDS_ANY_STATE, dds_entity_t, dds_return_loan, dds_sample_info_t,
    dds_take_mask,
};

/// Endpoints taken per call.
pub(super) const BATCH: usize = 64;

/// Takes all samples of a built-in topic. Passes each to `each` with true if its instance is alive.
pub(super) fn take_all(reader: dds_entity_t, each: &mut dyn FnMut(*const c_void, bool)) {
    loop {
        let mut found = [ptr::null_mut::<c_void>(); BATCH];
        let mut infos = [MaybeUninit::<dds_sample_info_t>::uninit(); BATCH];
        let places = (found.as_mut_ptr(), infos.as_mut_ptr().cast());
        // SAFETY: space for a batch; a null first element requests a loan.
        let count = unsafe {
            let most = BATCH as u32;
            dds_take_mask(reader, places.0, places.1, BATCH, most, DDS_ANY_STATE)
        };
        let taken = usize::try_from(count).unwrap_or(0).min(BATCH);
        for (sample, info) in found.iter().zip(&infos).take(taken) {
            // SAFETY: `count` elements are initialized.
            let state = unsafe { info.assume_init_ref() }.instance_state;
            each(sample.cast_const(), state == DDS_ALIVE_INSTANCE_STATE);
        }
        if taken == 0 {
            return;
        }
        // SAFETY: returns the loan of the call above.
        let _ = unsafe { dds_return_loan(reader, found.as_mut_ptr(), count) };
    }
}
