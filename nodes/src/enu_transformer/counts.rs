//! Counters and final report of the transformer.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::attitude::AttitudeReport;
use super::cloud_notes::CloudNote;
use super::refusals::{Refusal, most_frequent};

/// Counters of one transformer. Every cloud ends in exactly one of the `clouds_` counters
/// other than `clouds_in`, or is still queued.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TransformerCounts {
    /// Clouds received.
    pub clouds_in: u64,
    /// Clouds transformed and published.
    pub clouds_out: u64,
    /// Dropped: the data do not match the header, or no per-point time is usable.
    pub clouds_malformed: u64,
    /// Dropped: older than all stored poses.
    pub clouds_before_poses: u64,
    /// Dropped: in a gap of the poses longer than `max_pose_gap_s`.
    pub clouds_pose_gap: u64,
    /// Dropped: no covering pose within `max_wait_s`.
    pub clouds_pose_late: u64,
    /// Dropped: the mount of their frame is unknown, or its transforms do not cover them.
    pub clouds_no_mount: u64,
    /// Dropped: the oldest of a full queue.
    pub clouds_queue_full: u64,
    /// Dropped: queued when time jumped back.
    pub clouds_time_jump: u64,
    /// Points of published clouds before filtering.
    pub points_in: u64,
    /// Points published.
    pub points_out: u64,
    /// Points rejected: NaN or infinite.
    pub points_not_finite: u64,
    /// Points rejected: nearer than `min_range_m` or farther than `max_range_m`.
    pub points_out_of_range: u64,
    /// Points rejected: without a time in a cloud with times.
    pub points_no_time: u64,
    /// Poses accepted.
    pub poses_in: u64,
    /// Poses rejected: not finite or not a rotation.
    pub poses_invalid: u64,
    /// Poses rejected: the solution status of the INS is not good.
    pub poses_not_good: u64,
    /// Poses rejected: the transform of their body or reference frame is not published.
    #[serde(default)]
    pub poses_no_transform: u64,
    /// Poses rejected: duplicate stamp, or older than the newest without a gap there.
    pub poses_out_of_order: u64,
    /// Poses rejected: stamp of another time, unless several in a row agree on it.
    #[serde(default)]
    pub poses_stamp_jump: u64,
    /// Poses rejected: faster than `ins.max_speed_m_per_s`.
    #[serde(default)]
    pub poses_too_fast: u64,
    /// Accepted jumps of the poses to another place.
    #[serde(default)]
    pub place_jumps: u64,
    /// Backward steps of the poses' stamps (a log that loops).
    pub time_jumps: u64,
    /// Transforms of `/tf` and `/tf_static` rejected.
    pub transforms_refused: u64,
}

/// Report of an `enu_transformer`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TransformerReport {
    /// Counters of the state machine.
    pub counts: TransformerCounts,
    /// Clouds rejected by a full inbox or overrun before it.
    pub clouds_inbox_full: u64,
    /// Clouds lost on the network.
    #[serde(default)]
    pub clouds_lost_on_network: u64,
    /// Poses and transforms rejected by a full inbox or overrun before it.
    pub poses_inbox_full: u64,
    /// Poses and transforms lost on the network.
    #[serde(default)]
    pub poses_lost_on_network: u64,
    /// Undecodable samples.
    pub undecodable: u64,
    /// Clouds rejected by the publisher.
    pub clouds_not_published: u64,
    /// Rejected messages, by topic and reason, with value and remedy.
    #[serde(default)]
    pub refusals: Vec<Refusal>,
    /// Notes on corrected clouds, and on the source of point times.
    #[serde(default)]
    pub notes: Vec<CloudNote>,
    /// Attitudes that contradict the way of the machine.
    #[serde(default)]
    pub attitude: Option<AttitudeReport>,
}

impl TransformerCounts {
    /// Poses rejected for any reason.
    pub fn poses_refused(&self) -> u64 {
        self.poses_invalid
            + self.poses_not_good
            + self.poses_no_transform
            + self.poses_out_of_order
            + self.poses_stamp_jump
            + self.poses_too_fast
    }

    /// Counts a pose by the reason of its rejection, or a jump of its place.
    pub(super) fn add_pose(&mut self, reason: &str) {
        match reason {
            "poses_not_good" => self.poses_not_good += 1,
            "poses_out_of_order" => self.poses_out_of_order += 1,
            "poses_stamp_jump" => self.poses_stamp_jump += 1,
            "poses_too_fast" => self.poses_too_fast += 1,
            "place_jumps" => self.place_jumps += 1,
            _ => self.poses_invalid += 1,
        }
    }
}

impl TransformerReport {
    /// One-line cause of an empty map; `None` once clouds are published.
    pub fn cause_of_nothing(&self) -> Option<String> {
        let counts = &self.counts;
        if counts.clouds_out > 0 {
            return None;
        }
        let (poses, refused) = (counts.poses_in, counts.poses_refused());
        let text = |reason: &str| {
            let refusal = most_frequent(&self.refusals, reason);
            refusal.map(|refusal| format!("{}: {}", refusal.topic, refusal.text))
        };
        let all = poses + refused;
        Some(
            match (text("poses_"), text("clouds_").or(text("undecodable"))) {
                (Some(text), _) if refused > poses => {
                    format!("{poses} of {all} poses usable: {text}")
                }
                (_, Some(text)) => format!("0 of {} clouds usable: {text}", counts.clouds_in),
                _ if counts.clouds_in == 0 => "no cloud was received".to_owned(),
                _ if poses == 0 => "no pose was received".to_owned(),
                _ => "all clouds are waiting for covering poses".to_owned(),
            },
        )
    }

    /// Dropped clouds by reason, without zeros.
    pub fn dropped(&self) -> BTreeMap<String, u64> {
        let counts = &self.counts;
        let reasons = [
            ("malformed", counts.clouds_malformed),
            ("before_poses", counts.clouds_before_poses),
            ("pose_gap", counts.clouds_pose_gap),
            ("pose_late", counts.clouds_pose_late),
            ("no_mount", counts.clouds_no_mount),
            ("queue_full", counts.clouds_queue_full),
            ("time_jump", counts.clouds_time_jump),
            ("inbox_full", self.clouds_inbox_full),
            ("lost_on_network", self.clouds_lost_on_network),
            ("undecodable", self.undecodable),
            ("not_published", self.clouds_not_published),
        ];
        let lost = reasons.into_iter().filter(|(_, count)| *count > 0);
        lost.map(|(reason, count)| (reason.to_owned(), count))
            .collect()
    }
}
