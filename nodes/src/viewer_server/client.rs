//! One client of the broadcaster: its outbox, what it watches and the pace of its refusals.

use std::time::Duration;

use lattice_runtime::logging::Throttle;
use smol::channel::Sender;

use super::inputs::InputRefusal;
use super::outbox::{Outbox, Outgoing};
use super::protocol::status;
use super::watched::Watched;

/// Time between two words to a client about messages that were refused.
const WORDS_PERIOD: Duration = Duration::from_secs(1);

/// A client: what waits for it and what it wants to hear of.
pub(super) struct Client {
    pub outbox: Outbox,
    wake: Sender<()>,
    pub watched: Watched,
    /// True for one that follows the graph of nodes.
    pub follows_graph: bool,
    /// True after it has taken all that there was.
    pub idle: bool,
    refusals: Throttle,
}

impl Client {
    /// A client that comes now; `wake` wakes it.
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

    /// Lets it look for what waits.
    pub fn wake(&mut self) {
        self.idle = false;
        // One wake is enough.
        let _ = self.wake.try_send(());
    }

    /// Puts a message of the protocol before what waits.
    pub fn enqueue(&mut self, message: Outgoing) {
        self.outbox.answer(message);
        self.wake();
    }

    /// Tells it of a refusal, where it was not told of one just now.
    pub fn refuse(&mut self, refusal: InputRefusal) {
        if self.refusals.check().is_some() {
            self.enqueue(Outgoing::Text(status(refusal.words())));
        }
    }
}
