//! Delay of poses that were recorded out of order.

use lattice_bag::{BagReader, ReadOptions};
use lattice_msgs::builtin_interfaces::Time;

use super::topics::TopicError;
use crate::enu_transformer::StampOrder;

/// Examined part of the log, from its beginning: out of order poses occur from the start.
const SPAN_NS: i64 = 2_000_000_000;
/// Limit of examined messages.
const MAX_MESSAGES: usize = 2000;
/// Bytes of a message up to the end of its header stamp.
const HEAD_BYTES: usize = 12;

/// Largest delay, in nanoseconds, of an out of order message of topics with headers in the
/// first part of a log.
pub(super) fn delay_ns(bag: &BagReader, topics: Vec<String>) -> Result<i64, TopicError> {
    let mut longest_ns = 0;
    for topic in topics {
        let options = ReadOptions {
            topics: Some(vec![topic]),
            end_ns: bag
                .start_ns()
                .map(|start_ns| start_ns.saturating_add(SPAN_NS)),
            ..ReadOptions::default()
        };
        let mut order = StampOrder::new(i64::MAX);
        for message in bag.messages(&options)?.take(MAX_MESSAGES) {
            let message = message?;
            if let Some(stamp) = stamp(&message.data) {
                order.push(stamp.to_ns(), ());
                longest_ns = longest_ns.max(order.delay_ns(i64::MAX));
            }
        }
    }
    Ok(longest_ns)
}

/// Stamp at the beginning of a message.
fn stamp(data: &[u8]) -> Option<Time> {
    let head = data.get(..HEAD_BYTES)?;
    lattice_msgs::cdr::from_slice(head).ok()
}
