//! Replies of a server, and the requests that wait for one.

use std::sync::atomic::AtomicU64;

use smol::channel::{Receiver, Sender, bounded};

/// Requests without reply: the wire protocol has no rejection, so they are counted here.
pub(crate) struct Unanswered {
    pub name: String,
    /// Overwritten by newer requests before they were taken.
    pub lost: AtomicU64,
    /// Taken, but not decodable or without reply.
    pub failed: AtomicU64,
}

/// Replies to one request, from any thread. Of its clones, the first to send is used.
pub struct Reply<R>(Sender<R>);

impl<R> Clone for Reply<R> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<R> Reply<R> {
    /// Sends the reply. A request whose reply is dropped remains without reply.
    pub fn send(self, response: R) {
        // The server may have ended.
        let _ = self.0.try_send(response);
    }

    /// Creates a reply that goes to a receiver instead of a client.
    pub fn channel() -> (Self, Receiver<R>) {
        let (sender, receiver) = bounded(1);
        (Self(sender), receiver)
    }
}
