//! Counts of images, pixels and points, by reason.

use std::collections::BTreeMap;

use crate::segmenter::SegmenterCounts;
use serde::{Deserialize, Serialize};

/// Counters of pixels and points.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PointCounts {
    /// Pixels of depth images, those between strides left out.
    pub pixels: u64,
    /// Left out: without depth (0, NaN, infinite).
    pub pixels_no_depth: u64,
    /// Left out: no ray in front of the camera is seen there by its distortion.
    pub pixels_no_ray: u64,
    /// Left out: at an edge of the depth.
    pub pixels_at_edges: u64,
    /// Left out: nearer than `min_range_m` or farther than `max_range_m`.
    pub pixels_out_of_range: u64,
    /// Points published.
    pub points: u64,
    /// Of these, of no known class.
    pub points_unlabelled: u64,
}

/// Counters of one node. Every image ends in a cloud or in `dropped`, or still waits.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CloudCounts {
    /// Depth images received.
    pub depth_in: u64,
    /// Label images received.
    pub labels_in: u64,
    /// Images of confidences received.
    pub confidence_in: u64,
    /// Images of colours received, but for those that go to a network.
    pub color_in: u64,
    /// Clouds published.
    pub clouds_out: u64,
    /// Of these, without the probabilities that there are, as they would be too large.
    pub clouds_without_probs: u64,
    /// Pixels and points.
    #[serde(flatten)]
    pub points: PointCounts,
    /// Messages refused or dropped, by topic and reason.
    pub dropped: BTreeMap<String, u64>,
}

impl CloudCounts {
    /// Counts a message that was refused or dropped.
    pub fn drop_one(&mut self, topic: &str, reason: &str) {
        *self.dropped.entry(format!("{topic}_{reason}")).or_default() += 1;
    }
}

/// The end of a `semantic_cloud`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CloudReport {
    /// Everything counted by the state machine.
    #[serde(flatten)]
    pub counts: CloudCounts,
    /// Images that were sent and lost on the way, or that found the inbox full.
    pub images_lost: u64,
    /// Samples that did not decode.
    pub undecodable: u64,
    /// Clouds that could not be given to the publisher.
    pub clouds_not_published: u64,
    /// Counters of the network, if there is one inside of the node.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub network: Option<SegmenterCounts>,
}
