//! Map publication of a node: updates, and keyframes in several rounds on request.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use crate::hurry::Hurry;
use crate::start::LAST_FLUSH;
use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};
use lattice_msgs::std_msgs::Empty;
use lattice_runtime::qos::Qos;
use lattice_runtime::{
    Activity, Node, Publisher, RuntimeError, Server, Subscription, SubscriptionExecutor,
};

/// Keyframe chunks per update period: 3 MB.
const CHUNKS_PER_ROUND: usize = 50;

/// Publishers of `voxel_map` and `voxel_map_updates`, with pending chunks.
pub struct MapOutput {
    map: Publisher<LatticeMap>,
    updates: Publisher<LatticeMapUpdate>,
    /// True after a keyframe request.
    asked: Arc<AtomicBool>,
    /// Pending chunks of a keyframe.
    pending: VecDeque<Arc<LatticeMap>>,
    /// Lost updates up to the last keyframe for them.
    updates_lost: u64,
    /// Delays of keyframe chunks by a full publisher.
    chunks_waited: u64,
    /// Keyframe chunks that were left out since the node had to end.
    chunks_left_out: u64,
    hurry: Hurry,
    activity: Activity,
}

/// Topic and service for keyframe requests; dropping it ends them.
pub struct KeyframeRequests {
    /// The topic.
    pub topic: Subscription,
    _service: Server,
}

impl MapOutput {
    /// Creates the map topics, and the topic and service for keyframe requests. After `hurry` keyframes are left out.
    pub fn open(node: &Node, hurry: &Hurry) -> Result<(Self, KeyframeRequests), RuntimeError> {
        let output = Self {
            map: node.publisher("voxel_map", Qos::MAP)?,
            updates: node.publisher("voxel_map_updates", Qos::DELTAS)?,
            asked: Arc::default(),
            pending: VecDeque::new(),
            updates_lost: 0,
            chunks_waited: 0,
            chunks_left_out: 0,
            hurry: hurry.clone(),
            activity: node.activity(),
        };
        let ask = || {
            let asked = Arc::clone(&output.asked);
            move || asked.store(true, Ordering::Relaxed)
        };
        output.map.on_subscriber_joined(ask());
        // Also by topic: our followers need no reply, and the topic is delivered within a process.
        let (by_topic, by_call) = (ask(), ask());
        let heard = move |_: Arc<Empty>| by_topic();
        let requests = KeyframeRequests {
            topic: node.subscribe(
                "~/request_keyframe",
                Qos::DEFAULT,
                SubscriptionExecutor::Shared,
                heard,
            )?,
            _service: node.service_trigger("~/request_keyframe", move || {
                by_call();
                (true, "keyframe follows".into())
            })?,
        };
        Ok((output, requests))
    }

    /// Starts a keyframe for the map of a new epoch.
    pub fn replaced(&mut self) {
        self.pending.clear();
        self.asked.store(true, Ordering::Relaxed);
        self.activity.note();
    }

    /// Publishes an update, and a round of a keyframe after a request or a lost update.
    pub fn publish(
        &mut self,
        update: Vec<LatticeMapUpdate>,
        keyframe: impl FnOnce() -> Vec<LatticeMap>,
    ) {
        for chunk in update {
            if let Err(error) = self.updates.publish(Arc::new(chunk)) {
                log::debug!("update not published: {error}");
            }
        }
        if self.hurry.is_requested() {
            self.leave_out();
            return;
        }
        // Includes updates dropped later for a slow reader.
        let lost = self.updates.dropped();
        if lost != self.updates_lost {
            self.updates_lost = lost;
            self.asked.store(true, Ordering::Relaxed);
        }
        if self.pending.is_empty() && self.asked.swap(false, Ordering::Relaxed) {
            self.pending = keyframe().into_iter().map(Arc::new).collect();
        }
        // A large map takes several rounds, so that readers and queues are not flooded.
        for _ in 0..CHUNKS_PER_ROUND {
            let Some(chunk) = self.pending.front() else {
                break;
            };
            if self.map.publish(Arc::clone(chunk)).is_err() {
                self.chunks_waited += 1;
                break;
            }
            self.pending.pop_front();
        }
        // An update may be dropped until it is acknowledged.
        if !self.pending.is_empty() || !self.updates.is_acknowledged() {
            self.activity.note();
        }
    }

    fn leave_out(&mut self) {
        let chunks = self.pending.len();
        if chunks > 0 {
            log::warn!(
                "the node ends before it has sent {chunks} parts of its map to a late subscriber"
            );
        }
        self.chunks_left_out += chunks as u64;
        self.pending.clear();
    }

    /// Pending chunks of a keyframe.
    pub fn pending(&self) -> usize {
        self.pending.len()
    }

    /// Waits until both topics are sent, at most [`LAST_FLUSH`].
    pub fn flush(&self) {
        let begin = Instant::now();
        self.map.flush(LAST_FLUSH);
        let left = LAST_FLUSH.saturating_sub(begin.elapsed());
        self.updates.flush(left);
    }

    /// Updates not published.
    pub fn updates_lost(&self) -> u64 {
        self.updates.dropped()
    }

    /// Keyframe chunks not sent.
    pub fn chunks_lost(&self) -> u64 {
        let dropped = self.map.dropped().saturating_sub(self.chunks_waited);
        dropped + self.chunks_left_out
    }
}

/// Unique epoch, also across restarts.
pub fn epoch() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(1, |since| since.as_nanos() as u64)
}
