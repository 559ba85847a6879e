//! The map as a node hears it: both topics, what is lost of them, and keyframes asked for after that.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};
use lattice_msgs::std_msgs::Empty;
use lattice_runtime::logging::Throttle;
use lattice_runtime::qos::Qos;
use lattice_runtime::{
    Losses, Node, Publisher, RuntimeError, Subscription, SubscriptionExecutor, Undecoded,
};

use crate::compute::Inbox;
use crate::map_follower::{FollowError, Followed};

/// Counters of messages that did not come to the compute thread.
#[derive(Clone, Default)]
pub struct MapLosses {
    /// Messages that found the inbox full.
    pub at_inbox: Arc<AtomicU64>,
    before: Losses,
}

impl MapLosses {
    /// Subscribes to `map` and `map_updates`; chunks become events.
    pub fn subscribe<E: Send + 'static>(
        &self,
        node: &Node,
        inbox: &Inbox<E>,
        map: fn(Undecoded<LatticeMap>) -> E,
        update: fn(Undecoded<LatticeMapUpdate>) -> E,
    ) -> Result<[Subscription; 2], RuntimeError> {
        self.subscribe_to(node, ["map", "map_updates"], inbox, map, update)
    }

    /// The same of topics with other names.
    pub fn subscribe_to<E: Send + 'static>(
        &self,
        node: &Node,
        [map_topic, update_topic]: [impl AsRef<str>; 2],
        inbox: &Inbox<E>,
        map: impl Fn(Undecoded<LatticeMap>) -> E + Send + Sync + 'static,
        update: impl Fn(Undecoded<LatticeMapUpdate>) -> E + Send + Sync + 'static,
    ) -> Result<[Subscription; 2], RuntimeError> {
        let on_map = inbox.counting(&self.at_inbox, map, |map: &Undecoded<LatticeMap>| {
            map.bytes(|map| map.keys.len() + map.counts.len() * 10)
        });
        let on_update = inbox.counting(
            &self.at_inbox,
            update,
            |update: &Undecoded<LatticeMapUpdate>| {
                update.bytes(|update| update.keys.len() + update.counts.len() * 10)
            },
        );
        let maps = node.subscribe_undecoded(
            map_topic.as_ref(),
            Qos::MAP,
            SubscriptionExecutor::Shared,
            on_map,
        )?;
        let updates = node.subscribe_undecoded(
            update_topic.as_ref(),
            Qos::DELTAS,
            SubscriptionExecutor::Shared,
            on_update,
        )?;
        self.before.watch([&maps, &updates]);
        node.expect_publishers([&maps], "lattice_mapper", None, |_| true);
        Ok([maps, updates])
    }

    /// Messages lost on the way or at the inbox.
    pub fn count(&self) -> u64 {
        self.inbox_full() + self.on_network()
    }

    /// Messages that found the inbox, or the queue before it, full.
    pub fn inbox_full(&self) -> u64 {
        self.at_inbox.load(Ordering::Relaxed) + self.before.overrun()
    }

    /// Messages that were sent and did not come.
    pub fn on_network(&self) -> u64 {
        self.before.on_network()
    }

    /// Messages that are none.
    pub fn undecodable(&self) -> u64 {
        self.before.undecodable()
    }
}

/// Requests of a follower of the map to the mapper, and its words to the operator.
pub struct MapRequests {
    losses: MapLosses,
    /// Losses that a keyframe was asked for.
    seen: u64,
    request: Publisher<Empty>,
    refusals: Throttle,
    requests: Throttle,
}

impl MapRequests {
    /// Requests to a mapper of this name.
    pub fn new(node: &Node, mapper: &str, losses: &MapLosses) -> Result<Self, RuntimeError> {
        let topic = format!("{mapper}/request_keyframe");
        Ok(Self {
            losses: losses.clone(),
            seen: 0,
            request: node.publisher(&topic, Qos::DEFAULT)?,
            refusals: Throttle::new(Duration::from_secs(5)),
            requests: Throttle::new(Duration::from_secs(1)),
        })
    }

    /// Does what the outcome of a chunk asks for.
    pub fn followed(&self, result: Option<Result<Followed, FollowError>>) {
        match result {
            Some(Ok(Followed::NeedKeyframe)) => self.ask_for_keyframe(),
            Some(Err(error)) => {
                if let Some(more) = self.refusals.check() {
                    log::warn!("{error} ({more} more like it)");
                }
            }
            Some(Ok(Followed::Applied | Followed::Old)) | None => {}
        }
    }

    /// Asks for a keyframe if something has been lost since the call before.
    pub fn make_good(&mut self) {
        let lost = self.losses.count();
        if lost != self.seen {
            self.seen = lost;
            self.ask_for_keyframe();
        }
    }

    /// Asks for a keyframe, once a second at most.
    pub fn ask_for_keyframe(&self) {
        if self.requests.check().is_some()
            && let Err(error) = self.request.publish(Empty::default())
        {
            log::debug!("keyframe not requested: {error}");
        }
    }

    /// The losses.
    pub fn losses(&self) -> &MapLosses {
        &self.losses
    }
}
