//! Map subscriptions of a node: both topics, their losses, and keyframe requests after a loss.

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

/// Counters of messages lost before the compute thread.
#[derive(Clone, Default)]
pub struct MapLosses {
    /// Messages rejected by a full inbox.
    pub at_inbox: Arc<AtomicU64>,
    before: Losses,
}

impl MapLosses {
    /// Subscribes to `voxel_map` and `voxel_map_updates`; chunks become events.
    pub fn subscribe<E: Send + 'static>(
        &self,
        node: &Node,
        inbox: &Inbox<E>,
        map: fn(Undecoded<LatticeMap>) -> E,
        update: fn(Undecoded<LatticeMapUpdate>) -> E,
    ) -> Result<[Subscription; 2], RuntimeError> {
        self.subscribe_to(node, ["voxel_map", "voxel_map_updates"], inbox, map, update)
    }

    /// Subscribes to topics with other names.
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

    /// Number of messages lost on the network or at the inbox.
    pub fn count(&self) -> u64 {
        self.inbox_full() + self.on_network()
    }

    /// Number of messages rejected by a full inbox or overrun in its queue.
    pub fn inbox_full(&self) -> u64 {
        self.at_inbox.load(Ordering::Relaxed) + self.before.overrun()
    }

    /// Number of messages lost on the network.
    pub fn on_network(&self) -> u64 {
        self.before.on_network()
    }

    /// Number of undecodable messages.
    pub fn undecodable(&self) -> u64 {
        self.before.undecodable()
    }
}

/// Map of a node: its chunks, keyframe requests to the mapper, and warnings in the log.
pub struct MapRequests {
    losses: MapLosses,
    /// True after a keyframe was left out.
    left_out: bool,
    /// Losses up to the last keyframe request.
    seen: u64,
    request: Publisher<Empty>,
    refusals: Throttle,
    requests: Throttle,
}

impl MapRequests {
    /// Creates requests to the mapper of this name.
    pub fn new(node: &Node, mapper: &str, losses: &MapLosses) -> Result<Self, RuntimeError> {
        let topic = format!("{mapper}/request_keyframe");
        Ok(Self {
            losses: losses.clone(),
            left_out: false,
            seen: 0,
            request: node.publisher(&topic, Qos::DEFAULT)?,
            refusals: Throttle::new(Duration::from_secs(5)),
            requests: Throttle::new(Duration::from_secs(1)),
        })
    }

    /// Decodes a keyframe chunk and passes it to the follower.
    pub fn map(
        &mut self,
        chunk: Undecoded<LatticeMap>,
        follow: impl FnOnce(&LatticeMap) -> Result<Followed, FollowError>,
    ) {
        self.followed(chunk.decode().map(|chunk| follow(&chunk)));
    }

    /// Decodes an update chunk and passes it to the follower.
    pub fn update(
        &mut self,
        chunk: Undecoded<LatticeMapUpdate>,
        follow: impl FnOnce(&LatticeMapUpdate) -> Result<Followed, FollowError>,
    ) {
        self.followed(chunk.decode().map(|chunk| follow(&chunk)));
    }

    fn followed(&mut self, result: Option<Result<Followed, FollowError>>) {
        match result {
            Some(Ok(Followed::NeedKeyframe)) => self.ask_for_keyframe(),
            Some(Ok(Followed::LeftOut)) => {
                if !std::mem::replace(&mut self.left_out, true) {
                    log::warn!("the node ends before it has read all of the map that it received");
                }
            }
            Some(Err(error)) => {
                if let Some(more) = self.refusals.check() {
                    log::warn!("{error} ({more} more like it)");
                }
            }
            Some(Ok(Followed::Applied | Followed::Old)) | None => {}
        }
    }

    /// Requests a keyframe if messages were lost since the last call.
    pub fn make_good(&mut self) {
        let lost = self.losses.count();
        if lost != self.seen {
            self.seen = lost;
            self.ask_for_keyframe();
        }
    }

    /// Requests a keyframe, at most once a second.
    pub fn ask_for_keyframe(&self) {
        if self.requests.check().is_some()
            && let Err(error) = self.request.publish(Empty::default())
        {
            log::debug!("keyframe not requested: {error}");
        }
    }

    /// Counters of lost messages.
    pub fn losses(&self) -> &MapLosses {
        &self.losses
    }
}
