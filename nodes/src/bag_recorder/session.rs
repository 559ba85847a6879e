//! A recording at work: which topics are heard, and what of them was lost.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use lattice_bag::TopicSpec;
use lattice_runtime::{Load, Node, RemotePublisher, RuntimeError, Subscription};

use super::RecordedTopic;
use super::cache::{Cache, Item};
use super::choice::Choice;
use super::definitions::Definitions;
use super::offered;

/// Topics of one recording, at most: as many as a file of MCAP has.
const MAX_TOPICS: usize = 65_000;

/// Types whose messages are large: they are taken on threads of their own.
const LARGE: [&str; 3] = [
    "sensor_msgs/msg/PointCloud2",
    "sensor_msgs/msg/Image",
    "sensor_msgs/msg/CompressedImage",
];

/// Topics that are being recorded, by the order of their coming.
pub(super) struct Session {
    pub node: Node,
    pub choice: Choice,
    pub definitions: Definitions,
    pub cache: Arc<Cache>,
    /// True while nothing is taken.
    pub paused: Arc<AtomicBool>,
    pub topics: Vec<Subscription>,
    types: Vec<String>,
    /// Names that are recorded or were refused, with what was said of them.
    seen: BTreeMap<String, BTreeSet<String>>,
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
            types: Vec::new(),
            seen: BTreeMap::new(),
        }
    }

    /// Begins to hear topics that have come.
    pub(super) fn look(&mut self) {
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
            let types = self.seen.entry(topic.to_owned()).or_default();
            let first = types.first().cloned();
            let new_types = publishers
                .iter()
                .filter(|p| types.insert(p.type_name.clone()));
            let new_types: Vec<String> = new_types.map(|p| p.type_name.clone()).collect();
            let Some(ros_type) = first.or_else(|| new_types.first().cloned()) else {
                continue;
            };
            for other in new_types.iter().filter(|other| **other != ros_type) {
                log::warn!("{topic}: {other} is not recorded, the topic is one of {ros_type}");
            }
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
        let place = self.topics.len();
        if place >= MAX_TOPICS {
            log::warn!("{topic} is not recorded: there are {MAX_TOPICS} topics already");
            return Ok(());
        }
        let announced = publishers.iter().find_map(|p| p.type_hash.as_deref());
        let defined = self.definitions.of(ros_type, announced);
        if defined.is_none() {
            log::warn!(
                "{topic}: no definition of {ros_type} is known, it is recorded without one; name the folder \
                 of its package's `share` with --msg-path"
            );
        }
        let hash = defined.as_ref().map(|(_, hash)| hash.as_str());
        let hash = announced.or(hash).unwrap_or_default().to_owned();
        let (cache, paused, clock) = (self.cache.clone(), self.paused.clone(), self.node.clock());
        let handler = move |data: Vec<u8>| {
            let log_time_ns = clock.now_ns();
            // With simulated time there is none before the first message on /clock.
            if !paused.load(Relaxed) && log_time_ns > 0 {
                cache.push(Item::Message {
                    topic: place,
                    log_time_ns,
                    data,
                });
            }
        };
        let load = match LARGE.contains(&ros_type) {
            true => Load::Large,
            false => Load::Small,
        };
        // First, so that the topic is in the bag before its messages.
        self.cache.push(Item::Topic(TopicSpec {
            name: topic.to_owned(),
            type_name: ros_type.to_owned(),
            type_hash: hash,
            definition: defined.map(|(text, _)| text),
            offered_qos: publishers.iter().map(|p| offered::noted(p)).collect(),
        }));
        let qos = offered::subscription(publishers);
        let heard = self
            .node
            .subscribe_raw(topic, ros_type, qos, load, handler)?;
        self.topics.push(heard);
        self.types.push(ros_type.to_owned());
        log::info!("recording {topic} ({ros_type})");
        Ok(())
    }

    /// What became of each topic.
    pub(super) fn report(&self) -> Vec<RecordedTopic> {
        let topic = |(place, (heard, ros_type)): (usize, (&Subscription, &String))| RecordedTopic {
            name: heard.topic().to_owned(),
            type_name: ros_type.clone(),
            heard: heard.received(),
            lost: heard.lost().saturating_add(heard.undecodable()),
            not_written: self.cache.lost(place),
        };
        let topics = self.topics.iter().zip(&self.types);
        topics.enumerate().map(topic).collect()
    }

    /// Messages that did not get here or found no room.
    pub(super) fn lost(&self) -> u64 {
        let lost = self.topics.iter().map(Subscription::lost);
        lost.fold(self.cache.all_lost(), u64::saturating_add)
    }
}
