//! Input filter of machine poses: order, clock
//! and speed.

use std::sync::Arc;

use lattice_core::pose::{PushOutcome, StampedPose};

use super::drops::Drop;
use super::ins_options::InsSource;
use super::ins_refusal::InsRefusal;
use super::speed_gate::{Placed, TooFast};
use super::stamp_order::Refused;
use super::state::{EnuOutput, EnuTransformer};

impl EnuTransformer {
    /// Handles a pose of the machine in the map.
    pub(super) fn on_pose(&mut self, topic: &str, mut pose: StampedPose, out: &mut Vec<EnuOutput>) {
        if let Some(correction) = &self.options.correction {
            pose.map_from_base = correction * pose.map_from_base;
        }
        if !pose
            .map_from_base
            .translation
            .vector
            .iter()
            .all(|v| v.is_finite())
        {
            self.refuse_message(topic, &InsRefusal::Pose);
            return;
        }
        if *self.pose_topic != *topic {
            self.pose_topic = topic.into();
        }
        let before_ns = self.poses.newest_ns();
        let decision = self.order.push(pose.stamp_ns, pose);
        for refused in &decision.refused {
            self.refuse_message(topic, &InsRefusal::Stamp(*refused));
        }
        if let (true, Some((first_ns, _)), Some(before_ns)) =
            (decision.is_clock_set, decision.taken.first(), before_ns)
            && *first_ns <= before_ns
        {
            self.on_set_back(before_ns, out);
            self.poses.clear();
            self.speed.clear();
            self.odom_ns = None;
        }
        for (_, pose) in decision.taken {
            self.on_ordered_pose(topic, pose, out);
        }
    }

    /// Ends the poses: held ones are rejected.
    pub(super) fn finish_poses(&mut self) {
        let held = self.order.finish();
        let topic = Arc::clone(&self.pose_topic);
        for refused in held {
            self.refuse_message(&topic, &InsRefusal::Stamp(refused));
        }
        let held = self.speed.refuse_held();
        self.refuse_fast(&topic, &held);
    }

    /// Handles a pose whose stamp is in order.
    fn on_ordered_pose(&mut self, topic: &str, pose: StampedPose, out: &mut Vec<EnuOutput>) {
        if self.options.ins.source == InsSource::NavsatfixImu {
            // Fixes were checked before their interpolation.
            self.keep_pose(topic, pose, out);
            return;
        }
        let passed = self.speed.push(Placed {
            stamp_ns: pose.stamp_ns,
            position_m: pose.map_from_base.translation.vector,
            item: pose,
        });
        self.refuse_fast(topic, &passed.refused);
        if let Some(step) = passed.jump {
            self.refuse_message(topic, &InsRefusal::jump(&step));
            // There is no path between the places.
            self.poses.clear();
        }
        for placed in passed.taken {
            self.keep_pose(topic, placed.item, out);
        }
    }

    fn keep_pose(&mut self, topic: &str, pose: StampedPose, out: &mut Vec<EnuOutput>) {
        let is_newest = self
            .poses
            .newest_ns()
            .is_none_or(|newest_ns| pose.stamp_ns > newest_ns);
        match self.poses.insert(pose) {
            PushOutcome::Accepted | PushOutcome::JumpedBack => self.counts.poses_in += 1,
            PushOutcome::OutOfOrder => {
                let stamp_ns = pose.stamp_ns;
                self.refuse_message(topic, &InsRefusal::Stamp(Refused::SameStamp { stamp_ns }));
                return;
            }
            PushOutcome::NotFinite => {
                self.refuse_message(topic, &InsRefusal::Pose);
                return;
            }
        }
        if is_newest {
            self.clocks.on_step();
            self.attitudes.on_pose(&pose);
            self.warn_of_attitude();
            #[cfg(feature = "bags")]
            if let Some(samples) = &mut self.samples {
                samples.on_pose(&pose);
            }
            self.announce_pose(&pose, out);
        }
    }

    fn refuse_fast(&mut self, topic: &str, steps: &[TooFast]) {
        let max_speed_m_per_s = self.options.ins.max_speed_m_per_s;
        for step in steps {
            self.refuse_message(topic, &InsRefusal::too_fast(step, max_speed_m_per_s));
        }
    }

    /// Counts a rejected INS message, with its text.
    pub(super) fn refuse_message(&mut self, topic: &str, refusal: &InsRefusal) {
        let reason = refusal.reason();
        self.counts.add_pose(reason);
        self.refusals.add(topic, reason, || refusal.to_string());
    }

    /// Handles a backward step of the poses' clock from `before_ns`: clouds of the time before are transformed by
    /// the stored poses or dropped.
    pub(super) fn on_set_back(&mut self, before_ns: i64, out: &mut Vec<EnuOutput>) {
        self.counts.time_jumps += 1;
        let mut i = 0;
        while let Some(cloud) = self.waiting.get(i) {
            if self.clocks.is_open(&cloud.clock) {
                i += 1;
                continue;
            }
            let is_covered = matches!(self.coverage(cloud), Ok(()));
            if let Some(cloud) = self.waiting.take(i) {
                match is_covered {
                    true => self.place(&cloud, out),
                    false => self.drop_cloud(&cloud.topic, &Drop::TimeJump),
                }
            }
        }
        self.clocks.on_set_back(before_ns);
    }
}
