//! Message gate of a managed node. Inactive lifecycle nodes drop published and received messages, except
//! latched ones.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, Weak};

use crate::sync::lock;
use crate::transport::peers::Peers;

/// Message gate of a node; always open unless the node is managed.
pub(crate) struct LifecycleGate {
    open: AtomicBool,
    publishers: Mutex<Vec<Weak<Peers>>>,
}

impl Default for LifecycleGate {
    fn default() -> Self {
        Self {
            open: AtomicBool::new(true),
            publishers: Mutex::default(),
        }
    }
}

impl LifecycleGate {
    pub(crate) fn is_open(&self) -> bool {
        self.open.load(Relaxed)
    }

    /// Adds a publisher, whose match events are replayed when the gate opens.
    pub(crate) fn watch(&self, peers: &Arc<Peers>) {
        let mut publishers = lock(&self.publishers);
        publishers.retain(|peers| peers.strong_count() > 0);
        publishers.push(Arc::downgrade(peers));
    }

    /// Opens or closes the gate. Opening replays the match events of subscribers that joined meanwhile.
    pub(crate) fn set(&self, open: bool) {
        if self.open.swap(open, Relaxed) || !open {
            return;
        }
        let publishers = lock(&self.publishers).clone();
        for peers in publishers.iter().filter_map(Weak::upgrade) {
            peers.replay_match_events();
        }
    }
}
