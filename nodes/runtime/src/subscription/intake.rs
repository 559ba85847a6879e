//! The DDS reader of a subscription, which comes and goes.
//!
//! A reader must not be there when a publisher of the same topic is made in the same process (see
//! [`Transport::writers_known`]): it is closed before, and made again once discovery knows the publisher.
//!
//! [`Transport::writers_known`]: crate::port::Transport::writers_known

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use smol::channel::{Receiver, Sender, bounded};

use super::Stats;
use crate::graph::{NodeEndpoint, NodeId};
use crate::peers::Peers;
use crate::port::SampleReader;
use crate::qos::Qos;
use crate::sync::{lock, wait_for};

/// A task that runs closes its reader at once.
const PATIENCE: Duration = Duration::from_secs(1);

/// Orders to the task of a subscription. It drops the sender of an order that is carried out.
pub(crate) enum Command {
    /// Take samples from this reader.
    Use(Box<dyn SampleReader>),
    /// Close the reader.
    Close(Sender<()>),
    /// Give the handler everything that waits in this process.
    WorkOff(Sender<()>),
}

/// Handle of a subscription's task, with everything that its reader is made from.
pub(crate) struct Intake {
    pub node: NodeId,
    pub topic: String,
    pub type_name: String,
    pub qos: Qos,
    pub max_bytes: usize,
    pub peers: Arc<Peers>,
    pub stats: Arc<Stats>,
    pub commands: Sender<Command>,
    pub is_open: AtomicBool,
    pub graph: Mutex<Option<NodeEndpoint>>,
}

impl Intake {
    /// Gives a reader to the task; `graph` is its place there.
    pub(crate) fn open(&self, reader: Box<dyn SampleReader>, graph: NodeEndpoint) {
        self.is_open.store(true, Relaxed);
        // Fails only if the subscription has ended.
        let _ = self.commands.try_send(Command::Use(reader));
        lock(&self.graph).replace(graph);
    }

    /// Gives the task an order; the receiver ends when it is carried out. `None`: the task has ended.
    pub(crate) fn order(&self, order: fn(Sender<()>) -> Command) -> Option<Receiver<()>> {
        let (done, carried_out) = bounded(1);
        self.commands.try_send(order(done)).ok()?;
        Some(carried_out)
    }

    /// Has the task close the reader, and waits for that.
    pub(crate) fn close(&self) {
        let Some(closed) = self.order(Command::Close) else {
            return;
        };
        let now = Instant::now();
        if !wait_for(&closed, now.checked_add(PATIENCE).unwrap_or(now)) {
            log::warn!(
                "{}: a publisher was made while the subscription of this process was busy; make \
                 publishers outside handlers, timers and callbacks",
                self.topic
            );
        }
        self.is_open.store(false, Relaxed);
        lock(&self.graph).take();
        self.peers.remove(|_| true);
    }
}
