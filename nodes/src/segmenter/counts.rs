//! Counters and report of a segmenter.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Counters of one node. Every image is labelled or in `dropped`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SegmenterCounts {
    /// Images received.
    pub images_in: u64,
    /// Label images produced.
    pub labels_out: u64,
    /// Images rejected or dropped, by reason.
    pub dropped: BTreeMap<String, u64>,
}

/// Report of a `segmenter`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SegmenterReport {
    /// Counters of the state machine.
    #[serde(flatten)]
    pub counts: SegmenterCounts,
    /// Images lost on the network.
    pub images_lost: u64,
    /// Undecodable samples.
    pub undecodable: u64,
}
