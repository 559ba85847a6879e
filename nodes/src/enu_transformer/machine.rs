//! Inputs of the transformer, and the clouds that they complete.

use std::sync::Arc;

use lattice_core::pose::PoseMiss;
use lattice_msgs::sensor_msgs::PointCloud2;

use super::drops::Drop;
use super::ins::InsMessage;
use super::state::{CLOCK_JUMP_NS, EnuOutput, EnuTransformer};
use super::verdict::Verdict;
use super::waiting::WaitingCloud;
use crate::cloud_input::CloudInputError;

impl EnuTransformer {
    /// Handles a message of the INS on a topic.
    pub fn on_ins(&mut self, topic: &str, message: InsMessage, now_ns: i64) -> Vec<EnuOutput> {
        let mut out = Vec::new();
        self.advance(now_ns);
        match self.ins.decode(message) {
            Ok(poses) => {
                for pose in poses {
                    self.on_body_pose(topic, pose, now_ns, &mut out);
                }
            }
            Err(refusal) => self.refuse_message(topic, &refusal),
        }
        if let InsMessage::Imu(imu) = message {
            self.on_inertial(topic, imu);
        }
        for refusal in self.ins.take_refused() {
            self.refuse_message(topic, &refusal);
        }
        self.announce_origin(&mut out);
        self.serve(now_ns, &mut out);
        out
    }

    /// Handles a cloud of a sensor on a topic; it is returned at once, or later when its poses have arrived.
    pub fn on_cloud(
        &mut self,
        topic: &str,
        message: Arc<PointCloud2>,
        now_ns: i64,
    ) -> Vec<EnuOutput> {
        let mut out = Vec::new();
        self.advance(now_ns);
        self.counts.clouds_in += 1;
        match WaitingCloud::new(topic, message, now_ns, &self.options, &mut self.notes) {
            Ok(mut cloud) => {
                self.mounts.keep(&cloud.frame);
                let newest_ns = self.poses.newest_ns();
                let Some(clock) = self.clocks.on_cloud(topic, cloud.stamp_ns, newest_ns) else {
                    self.drop_cloud(topic, &Drop::TimeJump);
                    return out;
                };
                cloud.clock = clock;
                cloud.newest_pose_ns = newest_ns;
                let gone = self.waiting.push(cloud);
                for cloud in gone {
                    self.drop_cloud(&cloud.topic, &Drop::QueueFull);
                }
                self.serve(now_ns, &mut out);
            }
            Err(error) => self.drop_cloud(topic, &Drop::Malformed(error)),
        }
        out
    }

    /// Counts a cloud of a topic that was not converted.
    pub fn on_unconverted(&mut self, topic: &str, error: &CloudInputError) {
        self.counts.clouds_in += 1;
        self.drop_cloud(topic, &Drop::Unconverted(error.clone()));
    }

    /// Counts a message of a topic that did not decode.
    pub fn on_undecodable(&mut self, topic: &str, error: &dyn std::fmt::Display) {
        self.refusals
            .add(topic, "undecodable", || format!("does not decode: {error}"));
    }

    /// Drops clouds that have waited too long. To be called periodically.
    pub fn tick(&mut self, now_ns: i64) -> Vec<EnuOutput> {
        let mut out = Vec::new();
        self.advance(now_ns);
        self.serve(now_ns, &mut out);
        out
    }

    /// True if clouds wait for poses, or poses for their frame.
    pub fn is_waiting(&self) -> bool {
        self.waiting.len() > 0 || !self.waiting_poses.is_empty()
    }

    /// Ends the input: returns the clouds that poses cover, and counts the others by the reason of their drop.
    pub fn finish(&mut self) -> Vec<EnuOutput> {
        let mut out = Vec::new();
        self.refuse_waiting_poses();
        self.finish_poses();
        while let Some(cloud) = self.waiting.take(0) {
            match self.coverage(&cloud) {
                Ok(()) => self.place(&cloud, &mut out),
                Err(uncovered) => {
                    let reason = match uncovered.reason {
                        Drop::PoseLate {
                            miss: Some(PoseMiss::AfterEnd { .. }),
                            ahead_ns,
                        } => Drop::PoseLate {
                            miss: None,
                            ahead_ns,
                        },
                        reason => reason,
                    };
                    self.drop_cloud(&cloud.topic, &reason);
                }
            }
        }
        out
    }

    /// Handles a backward step of the receiving clock.
    pub(super) fn advance(&mut self, now_ns: i64) {
        let last_ns = self.last_now_ns.replace(now_ns).unwrap_or(now_ns);
        if now_ns < last_ns.saturating_sub(CLOCK_JUMP_NS) {
            self.refuse_waiting_poses();
            while let Some(cloud) = self.waiting.take(0) {
                self.drop_cloud(&cloud.topic, &Drop::TimeJump);
            }
        }
    }

    /// Transforms all clouds that can be transformed now, in the order of arrival.
    pub(super) fn serve(&mut self, now_ns: i64, out: &mut Vec<EnuOutput>) {
        self.settle_poses(now_ns, out);
        let mut i = 0;
        while let Some(cloud) = self.waiting.get(i) {
            match self.verdict(cloud, now_ns) {
                Verdict::Wait => i += 1,
                Verdict::Drop(reason) => {
                    if let Some(cloud) = self.waiting.take(i) {
                        self.drop_cloud(&cloud.topic, &reason);
                    }
                }
                Verdict::Transform => {
                    if let Some(cloud) = self.waiting.take(i) {
                        self.place(&cloud, out);
                    }
                }
            }
        }
    }
}
