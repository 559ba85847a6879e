//! Samples in Cyclone's serialised form.

use std::ptr::{self, NonNull};

use cyclors::{
    ddsi_serdata, ddsi_serdata_from_ser_iov, ddsi_serdata_kind_SDK_DATA, ddsi_serdata_size,
    ddsi_serdata_to_ser_ref, ddsi_serdata_to_ser_unref, ddsi_serdata_unref, ddsi_sertype, iovec,
};

use crate::port::ENCAPSULATION_BYTES;

/// Samples on the wire are multiples of this, bytes. Cyclone reads so far also where a sample ends before.
const WORD_BYTES: usize = 4;

/// A reference to a serialised sample, encapsulation header first.
pub(super) struct Serialised(NonNull<ddsi_serdata>);

// SAFETY: Cyclone counts references atomically and never changes a sample that is made.
unsafe impl Send for Serialised {}

impl Serialised {
    /// A copy of the body of a little-endian CDR sample, padded with zeros. None: longer than Cyclone
    /// takes.
    ///
    /// # Safety
    ///
    /// `sertype` is that of an entity that lives during the call.
    pub(super) unsafe fn from_body(sertype: *const ddsi_sertype, body: &[u8]) -> Option<Self> {
        let padding = body.len().wrapping_neg() % WORD_BYTES;
        let zeros = [0; WORD_BYTES];
        let zeros = zeros.get(..padding)?;
        // Little-endian CDR; the last two bits of the options count the padding (XTypes 1.3, 7.6.3.1.2).
        let header: [u8; ENCAPSULATION_BYTES] = [0, 1, 0, u8::try_from(padding).ok()?];
        let bytes = ENCAPSULATION_BYTES.checked_add(body.len())?;
        let bytes = bytes.checked_add(padding)?;
        if i32::try_from(bytes).is_err() {
            return None;
        }
        let part = |part: &[u8]| iovec {
            iov_base: part.as_ptr().cast_mut().cast(),
            iov_len: part.len(),
        };
        let parts = [part(&header), part(body), part(zeros)];
        // SAFETY: the caller says that `sertype` is alive; the parts are read, `bytes` in all, and copied.
        let made = unsafe {
            let (count, first) = (parts.len(), parts.as_ptr());
            ddsi_serdata_from_ser_iov(sertype, ddsi_serdata_kind_SDK_DATA, count, first, bytes)
        };
        NonNull::new(made).map(Self)
    }

    /// Takes over a reference.
    ///
    /// # Safety
    ///
    /// Null, or a reference to a sample of a blob topic that nobody else gives back.
    pub(super) unsafe fn from_raw(sample: *mut ddsi_serdata) -> Option<Self> {
        NonNull::new(sample).map(Self)
    }

    /// The reference, which the caller gives back.
    pub(super) fn into_raw(self) -> *mut ddsi_serdata {
        let raw = self.0.as_ptr();
        std::mem::forget(self);
        raw
    }

    /// Length with the header.
    pub(super) fn len(&self) -> usize {
        // SAFETY: `self` holds a reference.
        unsafe { ddsi_serdata_size(self.0.as_ptr()) as usize }
    }

    /// Copies the sample, header first, into a buffer that is used again.
    pub(super) fn copy_into(&self, buffer: &mut Vec<u8>) {
        buffer.clear();
        let mut place = iovec {
            iov_base: ptr::null_mut(),
            iov_len: 0,
        };
        // SAFETY: `self` holds a reference; the place that is given lies in the sample, is as long as
        // it says, and stays until it is given back, once.
        unsafe {
            let sample = self.0.as_ptr();
            let kept = ddsi_serdata_to_ser_ref(sample, 0, self.len(), &mut place);
            if !place.iov_base.is_null() {
                let bytes = std::slice::from_raw_parts(place.iov_base.cast(), place.iov_len);
                buffer.extend_from_slice(bytes);
            }
            ddsi_serdata_to_ser_unref(kept, &place);
        }
    }
}

impl Drop for Serialised {
    fn drop(&mut self) {
        // SAFETY: gives back the reference that `self` holds, once.
        unsafe { ddsi_serdata_unref(self.0.as_ptr()) };
    }
}
