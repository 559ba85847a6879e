//! Counters of the transformer, and its report at the end.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{CloudNote, Refusal, most_frequent};

/// Counters of one transformer. Every cloud ends in exactly one of the `clouds_` counters
/// other than `clouds_in`, or still waits.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TransformerCounts {
    /// Clouds received.
    pub clouds_in: u64,
    /// Clouds transformed and published.
    pub clouds_out: u64,
    /// Dropped: the bytes are not what the header says, or no usable per-point time.
    pub clouds_malformed: u64,
    /// Dropped: older than every pose at hand.
    pub clouds_before_poses: u64,
    /// Dropped: in a gap of the poses longer than `max_pose_gap_s`.
    pub clouds_pose_gap: u64,
    /// Dropped: the pose that covers them did not come within `max_wait_s`.
    pub clouds_pose_late: u64,
    /// Dropped: the mount of their frame is unknown or its transforms do not cover them.
    pub clouds_no_mount: u64,
    /// Dropped: the waiting queue was full; the oldest goes.
    pub clouds_queue_full: u64,
    /// Dropped: they waited when time jumped back.
    pub clouds_time_jump: u64,
    /// Points of the clouds published or published in part.
    pub points_in: u64,
    /// Points published.
    pub points_out: u64,
    /// Points left out: NaN or infinite.
    pub points_not_finite: u64,
    /// Points left out: nearer than `min_range_m` or farther than `max_range_m`.
    pub points_out_of_range: u64,
    /// Points left out: without a time, though the cloud has times.
    pub points_no_time: u64,
    /// Poses taken.
    pub poses_in: u64,
    /// Poses refused: not finite or not a rotation.
    pub poses_invalid: u64,
    /// Poses refused: the INS says that its solution is not good.
    pub poses_not_good: u64,
    /// Poses refused: the transform of their frame, or of the frame that they are in, is not published.
    #[serde(default)]
    pub poses_no_transform: u64,
    /// Poses refused: of a stamp that came before, or older than the newest where no pose is missing.
    pub poses_out_of_order: u64,
    /// Poses refused: of another time than those before, unless several in a row agree on it.
    #[serde(default)]
    pub poses_stamp_jump: u64,
    /// Poses refused: the machine cannot have been there, by `ins.max_speed_m_per_s`.
    #[serde(default)]
    pub poses_too_fast: u64,
    /// Times that the poses jumped to another place and stayed there.
    #[serde(default)]
    pub place_jumps: u64,
    /// Times that the stamps of the poses were set back (a log that loops).
    pub time_jumps: u64,
    /// Transforms of `/tf` and `/tf_static` refused.
    pub transforms_refused: u64,
}

/// The end of an `enu_transformer`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TransformerReport {
    /// Everything counted by the state machine.
    pub counts: TransformerCounts,
    /// Clouds that found the inbox, or the queue before it, full.
    pub clouds_inbox_full: u64,
    /// Clouds that were sent and did not come.
    #[serde(default)]
    pub clouds_lost_on_network: u64,
    /// Poses and transforms that found the inbox, or the queue before it, full.
    pub poses_inbox_full: u64,
    /// Poses and transforms that were sent and did not come.
    #[serde(default)]
    pub poses_lost_on_network: u64,
    /// Samples that did not decode.
    pub undecodable: u64,
    /// Clouds that could not be given to the publisher.
    pub clouds_not_published: u64,
    /// Messages refused, by topic and reason, with value and remedy.
    #[serde(default)]
    pub refusals: Vec<Refusal>,
    /// Notes on clouds read otherwise than declared, and on the source of the times of their points.
    #[serde(default)]
    pub notes: Vec<CloudNote>,
}

impl TransformerCounts {
    /// Poses refused, for whichever reason.
    pub fn poses_refused(&self) -> u64 {
        self.poses_invalid
            + self.poses_not_good
            + self.poses_no_transform
            + self.poses_out_of_order
            + self.poses_stamp_jump
            + self.poses_too_fast
    }

    /// Counts a pose by the reason of its refusal, or a jump of its place.
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
    /// Cause, in one line, of a map that stays empty; `None` while clouds come out.
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
                _ if counts.clouds_in == 0 => "no cloud came".to_owned(),
                _ if poses == 0 => "no pose came".to_owned(),
                _ => "all clouds wait for poses that cover them".to_owned(),
            },
        )
    }

    /// Clouds lost by reason, zeros left out.
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
