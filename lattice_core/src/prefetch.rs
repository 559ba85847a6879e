//! Prefetching of memory into the caches.

/// Prefetches the first `LINES` cache lines of an item; no effect on results.
#[inline(always)]
#[allow(unsafe_code)]
pub(crate) fn prefetch<const LINES: usize, T: ?Sized>(item: &T) {
    #[cfg(target_arch = "x86_64")]
    for line in 0..LINES {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let first = std::ptr::from_ref(item).cast::<i8>();
        // SAFETY: a prefetch is a hint for any address, and reads nothing.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(first.wrapping_add(64 * line)) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = item;
}
