//! Roles of topics in a replay, and reasons for which a log cannot be replayed.

use lattice_bag::{BagError, BagReader};
use thiserror::Error;

use crate::cloud_input::CloudType;

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
    /// A topic of clouds that was asked for.
    #[error("no topic '{name}' of clouds in the log ({types}); it has {has}{remedy}")]
    MissingClouds {
        /// Asked for.
        name: String,
        /// Types of clouds.
        types: String,
        /// Topics of the log.
        has: String,
        /// Command that makes clouds of what it has; may be empty.
        remedy: String,
    },
    /// Nothing to map.
    #[error("no topic of clouds in the log ({types}); it has {has}{remedy}")]
    NoClouds {
        /// Types of clouds.
        types: String,
        /// Topics of the log.
        has: String,
        /// Command that makes clouds of what it has; may be empty.
        remedy: String,
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
    Cloud(CloudType),
    /// One kind of INS message.
    Ins(&'static str),
    /// `/tf` or, if true, `/tf_static`.
    Transforms(bool),
}

impl Role {
    /// True for clouds of any type.
    pub fn is_cloud(self) -> bool {
        matches!(self, Self::Cloud(_))
    }
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
