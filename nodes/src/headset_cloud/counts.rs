//! Counts of messages, surfaces, pixels and points, by reason.

use std::collections::BTreeMap;

use crate::segmenter::SegmenterCounts;
use serde::{Deserialize, Serialize};

/// Counters of pixels and points.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LookCounts {
    /// Pixels of label images, those between strides left out.
    pub pixels: u64,
    /// Left out: no ray in front of the camera is seen there by its distortion.
    pub pixels_no_ray: u64,
    /// Left out: the ray meets no mesh from `min_range_m` to `max_range_m`.
    pub pixels_no_mesh: u64,
    /// Points published.
    pub points: u64,
    /// Of these, of no known class.
    pub points_unlabelled: u64,
}

/// Counters of one node. Every image ends in a cloud or in `dropped`, or still waits.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct HeadsetCounts {
    /// Surfaces, chunks of them and markers received.
    pub meshes_in: u64,
    /// Label images received.
    pub labels_in: u64,
    /// Images of confidences received.
    pub confidence_in: u64,
    /// Poses or transforms received.
    pub poses_in: u64,
    /// Sessions that took the place of another.
    pub sessions: u64,
    /// Surfaces that are new or replaced.
    pub surfaces_replaced: u64,
    /// Surfaces that the headset took away.
    pub surfaces_removed: u64,
    /// Triangles left out: they have no area.
    pub triangles_degenerate: u64,
    /// Clouds published.
    pub clouds_out: u64,
    /// Of these, without the probabilities that there are, as they would be too large.
    pub clouds_without_probs: u64,
    /// Pixels and points.
    #[serde(flatten)]
    pub look: LookCounts,
    /// Messages refused or dropped, by topic and reason.
    pub dropped: BTreeMap<String, u64>,
}

impl HeadsetCounts {
    /// Counts messages that were refused or dropped.
    pub fn drop_some(&mut self, topic: &str, reason: &str, number: u64) {
        if number > 0 {
            *self.dropped.entry(format!("{topic}_{reason}")).or_default() += number;
        }
    }
}

/// The end of a `headset_cloud`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct HeadsetReport {
    /// Everything counted by the state machine.
    #[serde(flatten)]
    pub counts: HeadsetCounts,
    /// Messages that were sent and lost on the way, or that found the inbox full.
    pub messages_lost: u64,
    /// Samples that did not decode.
    pub undecodable: u64,
    /// Clouds that could not be given to the publisher.
    pub clouds_not_published: u64,
    /// Counters of the network, if there is one inside of the node.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub network: Option<SegmenterCounts>,
}
