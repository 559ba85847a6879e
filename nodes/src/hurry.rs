//! Request to a node that has to end to leave out work.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Cells of a map between two looks at a [`Hurry`]: a millisecond.
pub const CELLS_BETWEEN_LOOKS: usize = 4096;
/// Cells of a map that are sorted, then worked off, between two looks at a [`Hurry`]: some 50 ms.
pub const CELLS_SORTED: usize = 1 << 18;

/// Request to a compute thread to leave out work, since its node has to end.
#[derive(Clone, Debug, Default)]
pub struct Hurry(Arc<AtomicBool>);

impl Hurry {
    /// True after the request.
    pub fn is_requested(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// Requests it.
    pub fn request(&self) {
        self.0.store(true, Ordering::Relaxed);
    }
}
