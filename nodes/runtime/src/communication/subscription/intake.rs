//! Handle of a subscription's task.

use std::sync::Arc;

use smol::channel::{Receiver, Sender, bounded};

use super::Stats;
use crate::graph::local_graph::NodeEndpoint;
use crate::transport::peers::Peers;

/// Subscription as registered in the process.
pub(crate) struct Intake {
    pub topic: String,
    pub type_name: String,
    pub peers: Arc<Peers>,
    pub stats: Arc<Stats>,
    /// Orders to process all queued messages of this process; the task drops the received sender
    /// when done.
    pub orders: Sender<Sender<()>>,
    pub _graph: NodeEndpoint,
}

impl Intake {
    /// Orders the task to process all queued messages of this process; the receiver closes when done.
    /// `None`: the task has ended.
    pub(crate) fn work_off(&self) -> Option<Receiver<()>> {
        let (done, carried_out) = bounded(1);
        self.orders.try_send(done).ok()?;
        Some(carried_out)
    }
}
