//! Roles of topics in a replay, and reasons for which a log cannot be replayed.

use lattice_bag::{BagError, BagReader};
use thiserror::Error;

/// Reason for which a log cannot be replayed.
#[derive(Debug, Error)]
pub enum TopicError {
    /// A slice that is empty or begins before the log.
    #[error(
        "no clouds from {from_s} s to {to_s} s: a slice begins at 0 s or later and ends behind its beginning"
    )]
    Slice {
        /// Asked for.
        from_s: f64,
        /// Asked for.
        to_s: f64,
    },
    /// A topic that was asked for.
    #[error("no topic '{name}' of type {type_name} in the log; it has {has}")]
    Missing {
        /// Asked for.
        name: String,
        /// Needed type.
        type_name: &'static str,
        /// Topics of that type, or of any.
        has: String,
    },
    /// Nothing to map.
    #[error("no {type_name} topic in the log; it has {has}")]
    NoClouds {
        /// Needed type.
        type_name: &'static str,
        /// Topics of the log.
        has: String,
    },
    /// Clouds of several robots.
    #[error("clouds of several robots: {robots}; choose those of one with --points TOPIC")]
    Robots {
        /// Topics of clouds and of their transforms.
        robots: String,
    },
    /// The log itself.
    #[error(transparent)]
    Bag(#[from] BagError),
}

/// Role of a topic in the replay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// A sensor's clouds.
    Cloud,
    /// One kind of INS message.
    Ins(&'static str),
    /// `/tf` or, if true, `/tf_static`.
    Transforms(bool),
}

/// The topics of a log with their types, for an error.
pub(super) fn listing(bag: &BagReader) -> String {
    let topics = bag.topics().iter();
    let names = topics.map(|topic| format!("{} ({})", topic.name, topic.type_name));
    let names: Vec<String> = names.collect();
    match names.is_empty() {
        true => "no topics".into(),
        false => names.join(", "),
    }
}
