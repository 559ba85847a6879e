//! Activity of a process: timers rest without it.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::SeqCst};

use super::sync::Changed;

/// Counter of received messages, requests and changes of the graph; clones share it.
#[derive(Clone, Default)]
pub struct Activity(Arc<Shared>);

#[derive(Default)]
struct Shared {
    count: AtomicU64,
    changed: Changed,
}

impl Activity {
    /// Ends the rest of all timers that follow it. To be called by a node with work left for its next period.
    pub fn note(&self) {
        self.0.count.fetch_add(1, SeqCst);
        self.0.changed.notify();
    }

    /// Number of calls of [`Activity::note`] so far.
    pub(crate) fn count(&self) -> u64 {
        self.0.count.load(SeqCst)
    }

    /// Completes once [`Activity::count`] is not `seen`.
    pub(crate) async fn since(&self, seen: u64) {
        let changed = || (self.count() != seen).then_some(());
        self.0.changed.until(changed).await;
    }
}
