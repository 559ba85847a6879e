//! Queue of commands for a playback.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

/// Longest wait between command checks: a call is replied to within 100 ms.
pub(super) const SLICE: Duration = Duration::from_millis(20);

/// Command or query for a playback `P`, executed between two messages and during waits. Publishes nothing.
pub(super) type Command<P> = Box<dyn FnOnce(&mut P) + Send>;

/// Commands that are not executed yet.
pub(super) struct Commands<P> {
    // Kept, so that the channel stays open without servers.
    sender: Sender<Command<P>>,
    waiting: Receiver<Command<P>>,
}

impl<P> Commands<P> {
    /// An empty queue.
    pub(super) fn new() -> Self {
        let (sender, waiting) = channel();
        Self { sender, waiting }
    }

    /// Sender of commands.
    pub(super) fn sender(&self) -> Sender<Command<P>> {
        self.sender.clone()
    }

    /// Waits up to `patience` for the next command.
    pub(super) fn next(&self, patience: Duration) -> Option<Command<P>> {
        self.waiting.recv_timeout(patience).ok()
    }
}
