//! The gate of a managed node: while it is closed, publishers are silent and subscriptions deaf but for
//! latched topics.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, Weak};

use crate::peers::Peers;
use crate::sync::lock;

/// The gate in front of the topics of a node; open unless the node is managed.
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

    /// Adds a publisher, whose peers are met anew when the gate opens.
    pub(crate) fn watch(&self, peers: &Arc<Peers>) {
        let mut publishers = lock(&self.publishers);
        publishers.retain(|peers| peers.strong_count() > 0);
        publishers.push(Arc::downgrade(peers));
    }

    /// Opens or closes it. Subscribers that joined meanwhile are met when it opens.
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
