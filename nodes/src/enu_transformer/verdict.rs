//! Decision to transform, queue or drop a cloud.

use lattice_core::pose::{PoseMiss, TfMiss};

use super::drops::Drop;
use super::state::EnuTransformer;
use super::waiting::WaitingCloud;

/// Decision on a cloud at a time.
pub(super) enum Verdict {
    Transform,
    Wait,
    Drop(Drop),
}

/// Reason why poses or mounts do not cover a cloud.
pub(super) struct Uncovered {
    pub reason: Drop,
    /// True if later messages may cover it.
    pub may_come: bool,
}

impl EnuTransformer {
    pub(super) fn verdict(&self, cloud: &WaitingCloud, now_ns: i64) -> Verdict {
        let waited_s = now_ns.saturating_sub(cloud.arrived_ns) as f64 * 1e-9;
        let is_due = waited_s > self.options.longest_wait_s();
        // Clock steps and late poses are decided by the next poses.
        let is_open = self.is_order_ambiguous() || self.clocks.is_open(&cloud.clock);
        if !is_due && (is_open || !self.is_settled(cloud.last_ns)) {
            return Verdict::Wait;
        }
        match self.coverage(cloud) {
            Ok(()) => Verdict::Transform,
            Err(uncovered) if uncovered.may_come && !is_due => Verdict::Wait,
            Err(uncovered) => Verdict::Drop(uncovered.reason),
        }
    }

    /// Checks that poses and mounts cover all points of a cloud.
    pub(super) fn coverage(&self, cloud: &WaitingCloud) -> Result<(), Uncovered> {
        let uncovered = |reason, may_come| Uncovered { reason, may_come };
        for stamp_ns in [cloud.first_ns, cloud.last_ns] {
            self.map_from_base(stamp_ns).map_err(|miss| match miss {
                PoseMiss::Empty | PoseMiss::AfterEnd { .. } => {
                    let (then_ns, now_ns) = (cloud.newest_pose_ns, self.poses.newest_ns());
                    let then_ns = then_ns.filter(|then_ns| now_ns > Some(*then_ns));
                    let ahead_ns = then_ns.map(|then_ns| stamp_ns.saturating_sub(then_ns));
                    let miss = Some(miss);
                    uncovered(Drop::PoseLate { miss, ahead_ns }, true)
                }
                PoseMiss::BeforeStart { by_ns } => {
                    let newest_ns = self.poses.newest_ns().unwrap_or(stamp_ns);
                    let behind_ns = newest_ns.saturating_sub(stamp_ns);
                    uncovered(Drop::BeforePoses { by_ns, behind_ns }, false)
                }
                PoseMiss::Gap { .. } => uncovered(Drop::PoseGap(miss), false),
            })?;
            self.mount(&cloud.frame, stamp_ns).map_err(|miss| {
                let may_come = !matches!(miss, TfMiss::TooOld { .. } | TfMiss::Gap { .. });
                uncovered(Drop::no_mount(&cloud.frame, miss), may_come)
            })?;
        }
        Ok(())
    }

    /// True if no late pose before a time is expected, by the delays so far.
    fn is_settled(&self, stamp_ns: i64) -> bool {
        let memory_ns = (self.options.pose_span_s * 1e9) as i64;
        let delay_ns = self.order.delay_ns(memory_ns).max(self.expected_delay_ns);
        let newest_ns = self.poses.newest_ns();
        delay_ns == 0
            || newest_ns.is_none_or(|newest_ns| stamp_ns <= newest_ns.saturating_sub(delay_ns))
    }
}
