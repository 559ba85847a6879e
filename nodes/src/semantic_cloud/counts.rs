//! Counters of images, pixels and points, by reason.

use std::collections::BTreeMap;

use crate::segmenter::SegmenterCounts;
use serde::{Deserialize, Serialize};

/// Counters of pixels and points.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PointCounts {
    /// Pixels of depth images, after the stride.
    pub pixels: u64,
    /// Rejected: without depth (0, NaN, infinite).
    pub pixels_no_depth: u64,
    /// Rejected: outside the distortion model.
    pub pixels_no_ray: u64,
    /// Rejected: at a depth edge.
    pub pixels_at_edges: u64,
    /// Rejected: nearer than `min_range_m` or farther than `max_range_m`.
    pub pixels_out_of_range: u64,
    /// Points published.
    pub points: u64,
    /// Published points without a known class.
    pub points_unlabelled: u64,
}

/// Counters of one node. Every image ends in a cloud or in `dropped`, or is still queued.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CloudCounts {
    /// Depth images received.
    pub depth_in: u64,
    /// Label images received.
    pub labels_in: u64,
    /// Confidence images received.
    pub confidence_in: u64,
    /// Colour images received, except those for a network.
    pub color_in: u64,
    /// Clouds published.
    pub clouds_out: u64,
    /// Clouds published without probabilities, since they would be too large.
    pub clouds_without_probs: u64,
    /// Pixels and points.
    #[serde(flatten)]
    pub points: PointCounts,
    /// Messages rejected or dropped, by topic and reason.
    pub dropped: BTreeMap<String, u64>,
}

impl CloudCounts {
    /// Counts a message that was rejected or dropped.
    pub fn drop_one(&mut self, topic: &str, reason: &str) {
        *self.dropped.entry(format!("{topic}_{reason}")).or_default() += 1;
    }
}

/// Report of a `semantic_cloud`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CloudReport {
    /// Counters of the state machine.
    #[serde(flatten)]
    pub counts: CloudCounts,
    /// Images lost on the network or at the inbox.
    pub images_lost: u64,
    /// Undecodable samples.
    pub undecodable: u64,
    /// Clouds rejected by the publisher.
    pub clouds_not_published: u64,
    /// Counters of the built-in network, if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub network: Option<SegmenterCounts>,
}
