//! Delay with which the poses of a log were recorded out of order.

use lattice_bag::{BagReader, ReadOptions};
use lattice_msgs::builtin_interfaces::Time;

use super::topics::TopicError;
use crate::enu_transformer::StampOrder;

/// Part of the log that is read, from its beginning: poses out of order are so from the start.
const SPAN_NS: i64 = 2_000_000_000;
/// Most messages that are read.
const MAX_MESSAGES: usize = 2000;
/// Bytes of a message before the end of the stamp of its header.
const HEAD_BYTES: usize = 12;

/// Greatest delay, in nanoseconds, with which a message of topics that begin with a header came late in the
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

/// The stamp with which a message begins.
fn stamp(data: &[u8]) -> Option<Time> {
    let head = data.get(..HEAD_BYTES)?;
    lattice_msgs::cdr::from_slice(head).ok()
}
