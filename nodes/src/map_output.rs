//! A map as a node publishes it: updates, and keyframes in several rounds for whoever asks or joins.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};
use lattice_msgs::std_msgs::Empty;
use lattice_runtime::qos::Qos;
use lattice_runtime::{Node, Publisher, RuntimeError, Server, Subscription, SubscriptionExecutor};

/// Chunks of a keyframe published in one update period: 3 MB.
const CHUNKS_PER_ROUND: usize = 50;

/// Publishers of `map` and `map_updates`, and what is still to be published.
pub struct MapOutput {
    map: Publisher<LatticeMap>,
    updates: Publisher<LatticeMapUpdate>,
    /// A keyframe was asked for.
    asked: Arc<AtomicBool>,
    /// Chunks of a keyframe that are still to be published.
    pending: VecDeque<Arc<LatticeMap>>,
    /// Updates lost by the publisher that a keyframe was asked for.
    updates_lost: u64,
    /// Times that a chunk of a keyframe found the publisher full, and waited.
    chunks_waited: u64,
}

/// Topic and service by which keyframes are asked for, until it is dropped.
pub struct KeyframeRequests {
    /// The topic.
    pub topic: Subscription,
    _service: Server,
}

impl MapOutput {
    /// Opens the topics of a node, and the topic and service by which a keyframe is asked for.
    pub fn open(node: &Node) -> Result<(Self, KeyframeRequests), RuntimeError> {
        let output = Self {
            map: node.publisher("map", Qos::MAP)?,
            updates: node.publisher("map_updates", Qos::DELTAS)?,
            asked: Arc::default(),
            pending: VecDeque::new(),
            updates_lost: 0,
            chunks_waited: 0,
        };
        let ask = || {
            let asked = Arc::clone(&output.asked);
            move || asked.store(true, Ordering::Relaxed)
        };
        output.map.on_subscriber_joined(ask());
        // By topic too: our own followers need no answer, and the topic passes inside a process.
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

    /// Shows followers the map of a new epoch.
    pub fn replaced(&mut self) {
        self.pending.clear();
        self.asked.store(true, Ordering::Relaxed);
    }

    /// Publishes an update, and a round of a keyframe where one was asked for or an update was lost.
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
        // Also those that were taken and then found no reader that keeps up.
        let lost = self.updates.dropped();
        if lost != self.updates_lost {
            self.updates_lost = lost;
            self.asked.store(true, Ordering::Relaxed);
        }
        if self.pending.is_empty() && self.asked.swap(false, Ordering::Relaxed) {
            self.pending = keyframe().into_iter().map(Arc::new).collect();
        }
        // A large map takes several rounds: readers and queues are not flooded.
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
    }

    /// Chunks of a keyframe that are still to be published.
    pub fn pending(&self) -> usize {
        self.pending.len()
    }

    /// Waits until both topics are sent.
    pub fn flush(&self) {
        self.map.flush(Duration::from_secs(2));
        self.updates.flush(Duration::from_secs(2));
    }

    /// Updates that were not published.
    pub fn updates_lost(&self) -> u64 {
        self.updates.dropped()
    }

    /// Chunks of keyframes that the publisher took and did not send.
    pub fn chunks_lost(&self) -> u64 {
        self.map.dropped().saturating_sub(self.chunks_waited)
    }
}

/// Epochs of one map after another differ, those of restarted nodes too.
pub fn epoch() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(1, |since| since.as_nanos() as u64)
}
