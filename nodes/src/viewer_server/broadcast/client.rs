//! One client of the broadcaster: its outbox, watched parameters and rate of rejection notices.

use std::time::Duration;

use lattice_runtime::logging::Throttle;
use smol::channel::Sender;

use super::outbox::{Outbox, Outgoing};
use super::watched::Watched;
use crate::viewer_server::protocol::status;
use crate::viewer_server::session::InputRefusal;

/// Period of rejection notices to a client.
const WORDS_PERIOD: Duration = Duration::from_secs(1);

/// A client: its queued messages and its interests.
pub(super) struct Client {
    pub outbox: Outbox,
    wake: Sender<()>,
    pub watched: Watched,
    /// True while it follows the node graph.
    pub follows_graph: bool,
    /// True after it has taken all messages.
    pub idle: bool,
    refusals: Throttle,
}

impl Client {
    /// A new client; `wake` wakes its task.
    pub fn new(outbox: Outbox, wake: Sender<()>) -> Self {
        Self {
            outbox,
            wake,
            watched: Watched::default(),
            follows_graph: false,
            idle: false,
            refusals: Throttle::new(WORDS_PERIOD),
        }
    }

    /// Wakes its task.
    pub fn wake(&mut self) {
        self.idle = false;
        // One pending wake is enough.
        let _ = self.wake.try_send(());
    }

    /// Queues a protocol message ahead of data.
    pub fn enqueue(&mut self, message: Outgoing) {
        self.outbox.answer(message);
        self.wake();
    }

    /// Queues a rejection notice, unless one was sent recently.
    pub fn refuse(&mut self, refusal: InputRefusal) {
        if self.refusals.check().is_some() {
            self.enqueue(Outgoing::Text(status(refusal.words())));
        }
    }
}
