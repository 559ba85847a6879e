//! A running recording: its subscriptions and their losses.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use lattice_bag::TopicSpec;
use lattice_runtime::qos::Durability;
use lattice_runtime::{Node, RemotePublisher, RuntimeError, Subscription, SubscriptionExecutor};
use serde::Serialize;

use super::cache::{Cache, Item};
use super::choice::Choice;
use super::definitions::Definitions;
use super::offered;

/// Limit of topics per recording, that of an MCAP file.
const MAX_TOPICS: usize = 65_000;

/// Limit of warnings about types of one topic.
const MAX_TYPES: usize = 16;

/// Types with large messages, received on dedicated threads.
const LARGE: [&str; 3] = [
    "sensor_msgs/msg/PointCloud2",
    "sensor_msgs/msg/Image",
    "sensor_msgs/msg/CompressedImage",
];

/// Statistics of a recorded topic.
#[derive(Clone, Debug, Default, Serialize)]
pub struct RecordedTopic {
    /// Full name.
    pub name: String,
    /// Type.
    pub type_name: String,
    /// Received messages.
    pub heard: u64,
    /// Messages lost before reception, or too long.
    pub lost: u64,
    /// Messages dropped at the cache, or not representable in a bag.
    pub not_written: u64,
}

/// Recorded topics in the order of their discovery.
pub(super) struct Session {
    pub node: Node,
    pub choice: Choice,
    pub definitions: Definitions,
    pub cache: Arc<Cache>,
    /// True while recording is paused.
    pub paused: Arc<AtomicBool>,
    pub topics: Vec<RecordedSubscription>,
    /// Topics passed to the cache, including failed subscriptions.
    places: usize,
    /// Types seen for each topic name, the recorded one first.
    seen: BTreeMap<String, Vec<String>>,
}

/// A recorded topic.
pub(super) struct RecordedSubscription {
    subscription: Subscription,
    ros_type: String,
    place: usize,
}

impl Session {
    pub(super) fn new(
        node: Node,
        choice: Choice,
        definitions: Definitions,
        cache: Arc<Cache>,
        paused: bool,
    ) -> Self {
        Self {
            node,
            choice,
            definitions,
            cache,
            paused: Arc::new(AtomicBool::new(paused)),
            topics: Vec::new(),
            places: 0,
            seen: BTreeMap::new(),
        }
    }

    /// False before the first message on /clock with simulated time.
    pub(super) fn has_time(&self) -> bool {
        self.node.clock().now_ns() > 0
    }

    /// Subscribes to newly discovered topics.
    pub(super) fn look(&mut self) {
        let has_time = self.has_time();
        let publishers = self.node.remote_publishers();
        let mut by_topic: BTreeMap<&str, Vec<&RemotePublisher>> = BTreeMap::new();
        for publisher in &publishers {
            by_topic
                .entry(&publisher.topic)
                .or_default()
                .push(publisher);
        }
        for (topic, publishers) in by_topic {
            if !self.choice.wants(topic) {
                continue;
            }
            let is_new = !self.seen.contains_key(topic);
            // Latched samples are sent once, so subscribe only when there is a time to stamp them with.
            let latched = |p: &&RemotePublisher| p.durability == Durability::TransientLocal;
            if is_new && !has_time && publishers.iter().any(latched) {
                continue;
            }
            if is_new && self.seen.len() >= MAX_TOPICS {
                continue;
            }
            let types = self.seen.entry(topic.to_owned()).or_default();
            for publisher in &publishers {
                let other = &publisher.type_name;
                if types.contains(other) || types.len() >= MAX_TYPES {
                    continue;
                }
                if let Some(recorded) = types.first() {
                    log::warn!(
                        "{topic}: type {other} is not recorded; the topic is recorded as {recorded}"
                    );
                }
                types.push(other.clone());
            }
            let Some(ros_type) = types.first().cloned() else {
                continue;
            };
            let of_type = publishers.into_iter().filter(|p| p.type_name == ros_type);
            if is_new && let Err(error) = self.begin(topic, &ros_type, &Vec::from_iter(of_type)) {
                log::warn!("{topic} is not recorded: {error}");
            }
        }
    }

    fn begin(
        &mut self,
        topic: &str,
        ros_type: &str,
        publishers: &[&RemotePublisher],
    ) -> Result<(), RuntimeError> {
        let place = self.places;
        let announced = publishers.iter().find_map(|p| p.type_hash.as_deref());
        let defined = self.definitions.of(ros_type, announced);
        if defined.is_none() {
            log::warn!(
                "{topic}: no definition of {ros_type} is found, it is recorded without one; give the folder \
                 of its package's `share` with --msg-path"
            );
        }
        let hash = defined.as_ref().map(|(_, hash)| hash.as_str());
        let hash = announced.or(hash).unwrap_or_default().to_owned();
        let (cache, paused, clock) = (self.cache.clone(), self.paused.clone(), self.node.clock());
        let handler = move |data: Vec<u8>| {
            let log_time_ns = clock.now_ns();
            // Simulated time is 0 before the first message on /clock.
            if !paused.load(Relaxed) && log_time_ns > 0 {
                cache.push(Item::Message {
                    topic: place,
                    log_time_ns,
                    data,
                });
            }
        };
        let executor = match LARGE.contains(&ros_type) {
            true => SubscriptionExecutor::Dedicated,
            false => SubscriptionExecutor::Shared,
        };
        // First, so that the topic precedes its messages in the bag.
        self.places += 1;
        self.cache.push(Item::Topic(TopicSpec {
            name: topic.to_owned(),
            type_name: ros_type.to_owned(),
            type_hash: hash,
            definition: defined.map(|(text, _)| text),
            offered_qos: publishers.iter().map(|p| offered::noted(p)).collect(),
        }));
        let qos = offered::subscription(publishers, executor);
        let heard = self
            .node
            .subscribe_raw(topic, ros_type, qos, executor, handler)?;
        self.topics.push(RecordedSubscription {
            subscription: heard,
            ros_type: ros_type.to_owned(),
            place,
        });
        log::info!("recording {topic} ({ros_type})");
        Ok(())
    }

    /// Statistics of each topic, with its index.
    pub(super) fn report(&self) -> Vec<(usize, RecordedTopic)> {
        let numbers = |topic: &RecordedSubscription| RecordedTopic {
            name: topic.subscription.topic().to_owned(),
            type_name: topic.ros_type.clone(),
            heard: topic.subscription.received(),
            lost: (topic.subscription.lost()).saturating_add(topic.subscription.undecodable()),
            not_written: self.cache.lost(topic.place),
        };
        let topics = self.topics.iter();
        topics.map(|topic| (topic.place, numbers(topic))).collect()
    }

    /// Messages lost before reception or dropped at the cache.
    pub(super) fn lost(&self) -> u64 {
        let lost = self.topics.iter().map(|topic| topic.subscription.lost());
        lost.fold(self.cache.all_lost(), u64::saturating_add)
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use lattice_msgs::rosgraph_msgs::Clock;
    use lattice_msgs::{builtin_interfaces::Time, std_msgs};
    use lattice_runtime::env::Network;
    use lattice_runtime::qos::Qos;
    use lattice_runtime::ros_args::RosArgs;
    use lattice_runtime::{LoopbackDomain, Runtime};

    use super::super::cache::Next;
    use super::*;

    #[test]
    fn latched_samples_are_kept_for_the_first_time_on_the_clock() {
        let domain = LoopbackDomain::take().unwrap();
        let network = Network {
            domain_id: domain.id(),
            localhost_only: true,
            ..Network::from_env().unwrap()
        };
        let start = |name, args: &[&str]| {
            let args = RosArgs::parse(args.iter().map(|&arg| arg.to_owned())).unwrap();
            Runtime::with_transport(name, args, &network).unwrap()
        };
        let peer = start("peer", &[]);
        let node = peer.node("peer").unwrap();
        let latched = node.publisher("/latched", Qos::LATCHED).unwrap();
        let data = "kept".to_owned();
        latched.publish(std_msgs::String { data }).unwrap();
        let _other = (node.publisher::<std_msgs::String>("/other", Qos::DEFAULT)).unwrap();
        let clock = node.publisher("/clock", Qos::CLOCK_PLAYER).unwrap();

        let simulated = ["--ros-args", "-p", "use_sim_time:=true"];
        let recorder = start("bag_recorder", &simulated);
        let choice = Choice {
            topics: ["/latched", "/other"].map(str::to_owned).into(),
            ..Choice::default()
        };
        let cache = Arc::new(Cache::new(1000));
        let node = recorder.node("bag_recorder").unwrap();
        let mut session = Session::new(node, choice, Definitions::new(&[]), cache.clone(), false);
        let heard = |session: &Session| {
            let topics = session.topics.iter();
            Vec::from_iter(topics.map(|topic| topic.subscription.topic().to_owned()))
        };
        // The other is announced later: when it is known, so is the latched one.
        while !heard(&session).contains(&"/other".to_owned()) {
            session.look();
        }
        assert_eq!(heard(&session), ["/other"]);
        let _timer = peer.timer(Duration::from_millis(10), move || {
            let clock_time = Time::from_ns(7_000_000_000);
            let _ = clock.publish(Clock { clock: clock_time });
        });
        while heard(&session).len() < 2 {
            session.look();
        }
        loop {
            match cache.next(Duration::from_secs(60)) {
                Next::Item(Item::Message { log_time_ns, .. }) => {
                    assert_eq!(log_time_ns, 7_000_000_000);
                    break;
                }
                Next::Item(_) => {}
                Next::Nothing | Next::End => panic!("the latched sample is lost"),
            }
        }
    }
}
