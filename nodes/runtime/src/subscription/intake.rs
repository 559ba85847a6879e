//! The handle of a subscription's task.

use std::sync::Arc;

use smol::channel::{Receiver, Sender, bounded};

use super::Stats;
use crate::graph::NodeEndpoint;
use crate::peers::Peers;

/// A subscription as the process sees it.
pub(crate) struct Intake {
    pub topic: String,
    pub type_name: String,
    pub peers: Arc<Peers>,
    pub stats: Arc<Stats>,
    /// Orders to give the handler everything that waits in this process; the task drops the sender of one
    /// that is carried out.
    pub orders: Sender<Sender<()>>,
    pub _graph: NodeEndpoint,
}

impl Intake {
    /// Has the task give its handler all that waits in this process; the receiver ends when that is done.
    /// `None`: the task has ended.
    pub(crate) fn work_off(&self) -> Option<Receiver<()>> {
        let (done, carried_out) = bounded(1);
        self.orders.try_send(done).ok()?;
        Some(carried_out)
    }
}
