//! Latched messages for late joiners at a time of the recording, and static transforms recorded
//! later.

use std::collections::VecDeque;

use super::PlayedTopic;
use crate::{BagMessage, BagReader, TopicInfo, storage::Filter, topic::STATIC_DEPTH};

/// Limit of messages kept per topic.
const MAX_PER_TOPIC: u64 = 1000;
/// Limit of kept message bytes; beyond it the oldest are dropped, except the last one of each topic.
const MAX_BYTES: usize = 256 << 20;

/// Number of messages that the publishers of a topic kept for late joiners.
fn kept(topic: &TopicInfo) -> usize {
    let latched = topic.offered_qos.iter().filter(|qos| qos.latched);
    let depths = latched.map(|qos| match qos.keep_all {
        true => MAX_PER_TOPIC,
        false => qos.depth.max(1),
    });
    let least = match topic.has_static_transforms() {
        true => STATIC_DEPTH,
        false => 1,
    };
    let total = depths.fold(0, u64::saturating_add);
    usize::try_from(total.clamp(least, MAX_PER_TOPIC)).unwrap_or(1)
}

/// First messages of static transforms in a log, in order of log time and without duplicates.
///
/// Reads no further than their number in the bag's index.
pub(super) fn static_transforms(reader: &BagReader, topics: &[PlayedTopic]) -> Vec<BagMessage> {
    let is_static = |topic: &&PlayedTopic| topic.info.has_static_transforms();
    let topics: Vec<&PlayedTopic> = topics.iter().filter(is_static).collect();
    let counts = topics.iter().map(|topic| topic.info.message_count);
    let most = STATIC_DEPTH.saturating_mul(topics.len() as u64);
    let count = counts.fold(0, u64::saturating_add).min(most);
    let filter = Filter {
        topics: wanted(reader, topics),
        start_ns: i64::MIN,
        end_ns: None,
        past_damage: false,
    };
    let mut found: Vec<BagMessage> = Vec::new();
    let count = usize::try_from(count).unwrap_or(usize::MAX);
    // Damage is reported when it is played.
    for message in reader.filtered(filter).take(count).map_while(Result::ok) {
        let is_new =
            |known: &BagMessage| known.topic != message.topic || known.data != message.data;
        if found.iter().all(is_new) {
            found.push(message);
        }
    }
    found
}

/// Messages for a late joiner at a time: later static transforms first, the earliest last, so that each
/// frame has the next value in the log; then those and all other latched messages before that time.
pub(super) fn given_at(
    reader: &BagReader,
    topics: &[PlayedTopic],
    statics: &[BagMessage],
    from_ns: i64,
) -> VecDeque<BagMessage> {
    let before = latched_before(reader, topics, from_ns);
    let room = usize::try_from(STATIC_DEPTH)
        .unwrap_or(1)
        .saturating_sub(before.len());
    let later = statics
        .iter()
        .filter(|message| message.log_time_ns > from_ns);
    let mut later: Vec<BagMessage> = later.take(room).cloned().collect();
    later.reverse();
    later.into_iter().chain(before).collect()
}

/// Latched messages of `topics` before `before_ns`, in order of log time.
fn latched_before(
    reader: &BagReader,
    topics: &[PlayedTopic],
    before_ns: i64,
) -> VecDeque<BagMessage> {
    let latched: Vec<&PlayedTopic> = topics
        .iter()
        .filter(|topic| topic.info.is_latched())
        .collect();
    if latched.is_empty()
        || reader
            .start_ns()
            .is_none_or(|start_ns| start_ns >= before_ns)
    {
        return VecDeque::new();
    }
    let filter = Filter {
        topics: wanted(reader, latched.iter().copied()),
        start_ns: i64::MIN,
        end_ns: Some(before_ns),
        past_damage: false,
    };
    let mut kept_messages: VecDeque<BagMessage> = VecDeque::new();
    let mut bytes = 0_usize;
    for message in reader.filtered(filter) {
        // Damage is reported when it is played; it may be after this time.
        let Ok(message) = message else { break };
        let Some(topic) = latched
            .iter()
            .find(|topic| topic.bag_topic == message.topic)
        else {
            continue;
        };
        bytes = bytes.saturating_add(message.data.len());
        let newest = message.topic;
        kept_messages.push_back(message);
        let of_topic = kept_messages.iter().filter(|m| m.topic == newest).count();
        if of_topic > kept(&topic.info) {
            bytes = bytes.saturating_sub(drop_oldest(&mut kept_messages, newest));
        }
        while bytes > MAX_BYTES {
            let repeated =
                |m: &&BagMessage| kept_messages.iter().filter(|o| o.topic == m.topic).count() > 1;
            let Some(topic) = kept_messages.iter().find(repeated).map(|m| m.topic) else {
                break;
            };
            bytes = bytes.saturating_sub(drop_oldest(&mut kept_messages, topic));
        }
    }
    kept_messages
}

/// Drops the oldest message of a topic; returns its size, bytes.
fn drop_oldest(messages: &mut VecDeque<BagMessage>, topic: usize) -> usize {
    let oldest = messages.iter().position(|m| m.topic == topic);
    oldest
        .and_then(|index| messages.remove(index))
        .map_or(0, |m| m.data.len())
}

/// Selected topics, by index of the reader.
pub(super) fn wanted<'a>(
    reader: &BagReader,
    played: impl IntoIterator<Item = &'a PlayedTopic>,
) -> Vec<bool> {
    let mut wanted = vec![false; reader.topics().len()];
    for topic in played {
        if let Some(wanted) = wanted.get_mut(topic.bag_topic) {
            *wanted = true;
        }
    }
    wanted
}
