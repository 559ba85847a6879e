//! The messages that a late joiner at some time of the recording would have been given.

use std::collections::VecDeque;

use super::{PlayedTopic, wanted};
use crate::{BagMessage, BagQos, BagReader, storage::Filter};

/// Messages kept of one topic.
const MAX_PER_TOPIC: u64 = 1000;
/// Size of all kept messages, bytes; beyond it the oldest go, but for the last one of each topic.
const MAX_BYTES: usize = 256 << 20;

/// Number of the last messages of a topic that its publishers kept together.
fn kept(profiles: &[BagQos]) -> usize {
    let depth = |qos: &BagQos| match qos.keep_all {
        true => MAX_PER_TOPIC,
        false => qos.depth.max(1),
    };
    let latched = profiles.iter().filter(|qos| qos.latched);
    let total = latched
        .map(depth)
        .fold(0, u64::saturating_add)
        .clamp(1, MAX_PER_TOPIC);
    usize::try_from(total).unwrap_or(1)
}

/// The latched messages of `topics` before `before_ns`, in order of log time.
pub(super) fn latched_before(
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
        // Damage is told of where it is played; it may lie behind this time.
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
        if of_topic > kept(&topic.info.offered_qos) {
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

/// Drops the oldest message of a topic; the result is its size, bytes.
fn drop_oldest(messages: &mut VecDeque<BagMessage>, topic: usize) -> usize {
    let oldest = messages.iter().position(|m| m.topic == topic);
    oldest
        .and_then(|index| messages.remove(index))
        .map_or(0, |m| m.data.len())
}
