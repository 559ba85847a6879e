//! Servers of services, for clients of either rmw, and the calls of our own clients.

mod asking;
mod local;
mod serving;
mod wire;

pub(crate) use asking::{Asking, Waiting};
pub(crate) use local::{LocalCall, LocalServices};
pub(crate) use serving::Serving;

use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Mutex, Weak};
use std::time::Instant;

use smol::Task;
use smol::channel::{Receiver, Sender, bounded};

use super::graph::NodeEndpoint;
use super::outbox::Outbox;
use super::peers::Peers;
use super::sync::{lock, wait_for};

/// A server of a service; dropping it ends it.
#[must_use = "dropping a server ends it"]
pub struct Server {
    pub(crate) name: String,
    /// Hear of matches.
    pub(crate) _clients: Arc<Peers>,
    pub(crate) _task: Task<()>,
    pub(crate) _graph: [NodeEndpoint; 2],
}

impl Server {
    /// Full name of the service.
    pub fn name(&self) -> &str {
        &self.name
    }
}

/// Requests of a server that came to nothing: the wire knows no refusal, so they are told here.
pub(crate) struct Unanswered {
    pub name: String,
    /// Gave way to newer ones before they were taken.
    pub lost: AtomicU64,
    /// Were taken, and could not be read or answered.
    pub failed: AtomicU64,
}

/// Answers one request, from any thread. Of clones, the first to send counts.
pub struct Reply<R>(Sender<R>);

impl<R> Clone for Reply<R> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<R> Reply<R> {
    /// Sends the answer. A request whose reply is dropped instead is not answered.
    pub fn send(self, response: R) {
        // The server may have ended.
        let _ = self.0.try_send(response);
    }

    /// A reply that goes to the receiver instead of a client.
    pub fn channel() -> (Self, Receiver<R>) {
        let (sender, receiver) = bounded(1);
        (Self(sender), receiver)
    }
}

/// The servers of a process, for its end.
#[derive(Default)]
pub(crate) struct Answers {
    servers: Mutex<Vec<(EndOrder, Weak<Outbox>)>>,
}

/// Asks a server to end; it drops what it is sent once its answers are queued.
type EndOrder = Sender<Sender<()>>;

impl Answers {
    /// Adds a server that ends when asked through `end`.
    pub(crate) fn add(&self, end: EndOrder, replies: &Arc<Outbox>) {
        let mut servers = lock(&self.servers);
        servers.retain(|(end, _)| !end.is_closed());
        servers.push((end, Arc::downgrade(replies)));
    }

    /// Ends all servers once they have queued their answers to the requests they have taken; an answer
    /// that does not come holds them up until `deadline`. Returns the writers of the answers.
    pub(crate) fn end(&self, deadline: Instant) -> Vec<Arc<Outbox>> {
        let servers = std::mem::take(&mut *lock(&self.servers));
        let (done, all_done) = bounded(1);
        let mut writers = Vec::new();
        for (end, replies) in servers {
            // Fails where the server has ended.
            let _ = end.try_send(done.clone());
            writers.extend(replies.upgrade());
        }
        drop(done);
        if !wait_for(&all_done, deadline) {
            log::warn!("not every request was answered");
        }
        writers
    }
}
