//! Events of the compute thread, and the subscriptions that send them.

use std::sync::Arc;

use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};
use lattice_msgs::nav2_msgs::{ComputePathToPoseAction, ComputePathToPoseGoal};
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_runtime::qos::Qos;
use lattice_runtime::{
    GoalHandle, Node, RuntimeError, Subscription, SubscriptionExecutor, Undecoded,
};

use super::parameters::Settings;
use crate::compute::Inbox;
use crate::map_input::MapLosses;

/// Event for the compute thread.
pub(super) enum Event {
    /// Means of the thread to open and close its subscriptions by demand.
    Inputs(Box<Inputs>),
    Map(Undecoded<LatticeMap>),
    Update(Undecoded<LatticeMapUpdate>),
    Free(Undecoded<LatticeMap>),
    Transforms(Arc<TFMessage>, bool),
    /// A subscriber of the grid has joined.
    Joined,
    /// A subscriber of elevation has joined.
    ElevationJoined,
    Project,
    Goal(
        Box<ComputePathToPoseGoal>,
        GoalHandle<ComputePathToPoseAction>,
    ),
    /// A goal was canceled, or a search has ended.
    Plan,
    Settings(Box<Settings>),
    Finish,
}

/// Subscriptions that are open while somebody subscribes to an output, or wants a path.
pub(super) struct Inputs {
    pub(super) node: Node,
    pub(super) inbox: Inbox<Event>,
    pub(super) losses: MapLosses,
    pub(super) open: Vec<Subscription>,
}

impl Inputs {
    pub(super) fn open(&mut self, with_free: bool) -> Result<(), RuntimeError> {
        let mut open =
            Vec::from(
                self.losses
                    .subscribe(&self.node, &self.inbox, Event::Map, Event::Update)?,
            );
        if with_free {
            let bytes = |map: &Undecoded<LatticeMap>| map.bytes(|map| map.keys.len());
            let handler = self
                .inbox
                .counting(&self.losses.at_inbox, Event::Free, bytes);
            let shared = SubscriptionExecutor::Shared;
            open.push(
                self.node
                    .subscribe_undecoded("free", Qos::MAP, shared, handler)?,
            );
        }
        for (topic, qos, is_static) in [
            ("/tf", Qos::TF, false),
            ("/tf_static", Qos::TF_STATIC_LISTENER, true),
        ] {
            let inbox = self.inbox.clone();
            // Transforms count no bytes: a map must not keep them out.
            let handler = move |message: Arc<TFMessage>| {
                let _ = inbox.send(Event::Transforms(message, is_static), 0);
            };
            open.push(
                self.node
                    .subscribe(topic, qos, SubscriptionExecutor::Shared, handler)?,
            );
        }
        self.open = open;
        Ok(())
    }
}
