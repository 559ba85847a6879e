//! Counters of messages, surfaces, pixels and points, by reason.

use std::collections::BTreeMap;

use crate::segmenter::SegmenterCounts;
use serde::{Deserialize, Serialize};

/// Counters of pixels and points.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ViewCounts {
    /// Pixels of label images, after the stride.
    pub pixels: u64,
    /// Rejected: outside the distortion model.
    pub pixels_no_ray: u64,
    /// Rejected: the ray has no hit between `min_range_m` and `max_range_m`.
    pub pixels_no_mesh: u64,
    /// Points published.
    pub points: u64,
    /// Published points without a known class.
    pub points_unlabelled: u64,
}

/// Counters of one node. Every image ends in a cloud or in `dropped`, or is still queued.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct HeadsetCounts {
    /// Surfaces, their chunks and markers received.
    pub meshes_in: u64,
    /// Label images received.
    pub labels_in: u64,
    /// Confidence images received.
    pub confidence_in: u64,
    /// Poses or transforms received.
    pub poses_in: u64,
    /// Session changes.
    pub sessions: u64,
    /// Surfaces that are new or replaced.
    pub surfaces_replaced: u64,
    /// Surfaces removed by the headset.
    pub surfaces_removed: u64,
    /// Triangles without area, rejected.
    pub triangles_degenerate: u64,
    /// Clouds published.
    pub clouds_out: u64,
    /// Clouds published without probabilities, since they would be too large.
    pub clouds_without_probs: u64,
    /// Pixels and points.
    #[serde(flatten)]
    pub look: ViewCounts,
    /// Messages rejected or dropped, by topic and reason.
    pub dropped: BTreeMap<String, u64>,
}

impl HeadsetCounts {
    /// Counts messages that were rejected or dropped.
    pub fn drop_some(&mut self, topic: &str, reason: &str, number: u64) {
        if number > 0 {
            *self.dropped.entry(format!("{topic}_{reason}")).or_default() += number;
        }
    }
}

/// Report of a `headset_cloud`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct HeadsetReport {
    /// Counters of the state machine.
    #[serde(flatten)]
    pub counts: HeadsetCounts,
    /// Messages lost on the network or at the inbox.
    pub messages_lost: u64,
    /// Samples that did not decode.
    pub undecodable: u64,
    /// Clouds rejected by the publisher.
    pub clouds_not_published: u64,
    /// Counters of the built-in network, if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub network: Option<SegmenterCounts>,
}
