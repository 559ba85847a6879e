//! Service servers for clients of any rmw, and calls of our own clients.

mod local;
mod remote_calls;
mod reply;
mod serving;
mod wire;

pub(crate) use local::{LocalCall, LocalServices};
pub(crate) use remote_calls::{PendingCalls, RemoteCalls};
pub(crate) use serving::Serving;

use std::sync::{Arc, Mutex, Weak};
use std::time::Instant;

use smol::Task;
use smol::channel::{Sender, bounded};

use crate::graph::local_graph::NodeEndpoint;
use crate::sync::{lock, wait_for};
use crate::transport::outbox::Outbox;
use crate::transport::peers::Peers;
pub use reply::Reply;
pub(crate) use reply::Unanswered;

/// A service server; dropping it ends it.
#[must_use = "dropping a server ends it"]
pub struct Server {
    pub(crate) name: String,
    /// Peers, notified of matches.
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

/// Servers of a process, for its shutdown.
#[derive(Default)]
pub(crate) struct Answers {
    servers: Mutex<Vec<(EndOrder, Weak<Outbox>)>>,
}

/// Shutdown order for a server; it drops the received sender once its replies are queued.
type EndOrder = Sender<Sender<()>>;

impl Answers {
    /// Adds a server that ends on a message to `end`.
    pub(crate) fn add(&self, end: EndOrder, replies: &Arc<Outbox>) {
        let mut servers = lock(&self.servers);
        servers.retain(|(end, _)| !end.is_closed());
        servers.push((end, Arc::downgrade(replies)));
    }

    /// Ends all servers once they have queued their replies to the requests taken so far; missing
    /// replies delay the end until `deadline`. Returns the writers of the replies.
    pub(crate) fn end(&self, deadline: Instant) -> Vec<Arc<Outbox>> {
        let servers = std::mem::take(&mut *lock(&self.servers));
        let (done, all_done) = bounded(1);
        let mut writers = Vec::new();
        for (end, replies) in servers {
            // Fails if the server has ended.
            let _ = end.try_send(done.clone());
            writers.extend(replies.upgrade());
        }
        drop(done);
        if !wait_for(&all_done, deadline) {
            log::warn!(
                "some requests were not answered before the node ended; their clients wait for their timeouts"
            );
        }
        writers
    }
}
