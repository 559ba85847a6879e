//! Stamped transforms of one frame, in time order.

use nalgebra::Isometry3;
use std::collections::VecDeque;

use super::interpolate::{interpolate, is_rigid};
use super::pose_miss::PoseMiss;

#[derive(Clone, Debug, Default)]
pub(super) struct Track {
    samples: VecDeque<(i64, Isometry3<f64>)>,
}

impl Track {
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    pub fn oldest_ns(&self) -> Option<i64> {
        self.samples.front().map(|s| s.0)
    }

    pub fn newest_ns(&self) -> Option<i64> {
        self.samples.back().map(|s| s.0)
    }

    pub fn clear(&mut self) {
        self.samples.clear();
    }

    /// Inserts a sample in time order; false if its time exists already.
    pub fn insert(&mut self, stamp_ns: i64, pose: Isometry3<f64>) -> bool {
        let at = match self.newest_ns() {
            Some(newest_ns) if stamp_ns <= newest_ns => {
                match self.samples.binary_search_by_key(&stamp_ns, |s| s.0) {
                    Ok(_) => return false,
                    Err(at) => at,
                }
            }
            _ => self.samples.len(),
        };
        self.samples.insert(at, (stamp_ns, pose));
        true
    }

    /// Drops samples older than the newest by more than `span_ns`, and the oldest beyond `max_samples`.
    pub fn trim(&mut self, span_ns: i64, max_samples: usize) {
        let Some(newest_ns) = self.newest_ns() else {
            return;
        };
        let horizon_ns = newest_ns.saturating_sub(span_ns);
        while self.samples.len() > max_samples
            || self.oldest_ns().is_some_and(|oldest| oldest < horizon_ns)
        {
            self.samples.pop_front();
        }
    }

    /// Pose at a time: exact at a sample, else interpolated between two that are at most `max_gap_ns` apart.
    pub fn at(&self, stamp_ns: i64, max_gap_ns: i64) -> Result<Isometry3<f64>, PoseMiss> {
        let (Some(oldest_ns), Some(newest_ns)) = (self.oldest_ns(), self.newest_ns()) else {
            return Err(PoseMiss::Empty);
        };
        if stamp_ns < oldest_ns {
            return Err(PoseMiss::BeforeStart {
                by_ns: oldest_ns.saturating_sub(stamp_ns),
            });
        }
        if stamp_ns > newest_ns {
            return Err(PoseMiss::AfterEnd {
                by_ns: stamp_ns.saturating_sub(newest_ns),
            });
        }
        let next = self.samples.partition_point(|s| s.0 < stamp_ns);
        let Some((after_ns, after)) = self.samples.get(next) else {
            return Err(PoseMiss::Empty);
        };
        if *after_ns == stamp_ns {
            return Ok(*after);
        }
        let Some((before_ns, before)) = next.checked_sub(1).and_then(|i| self.samples.get(i))
        else {
            return Err(PoseMiss::Empty);
        };
        let gap_ns = after_ns.saturating_sub(*before_ns);
        if gap_ns > max_gap_ns {
            return Err(PoseMiss::Gap { gap_ns, max_gap_ns });
        }
        let fraction = stamp_ns.saturating_sub(*before_ns) as f64 / gap_ns as f64;
        Ok(interpolate(before, after, fraction))
    }

    /// Samples between two times (exclusive), in order.
    pub fn between(
        &self,
        after_ns: i64,
        before_ns: i64,
    ) -> impl Iterator<Item = &(i64, Isometry3<f64>)> {
        let first = self.samples.partition_point(|s| s.0 <= after_ns);
        let samples = self.samples.iter().skip(first);
        samples.take_while(move |s| s.0 < before_ns)
    }

    pub fn validate(&self, max_samples: usize) -> Result<(), String> {
        if self.samples.len() > max_samples {
            return Err(format!(
                "{} samples, over {max_samples}",
                self.samples.len()
            ));
        }
        for (a, b) in self.samples.iter().zip(self.samples.iter().skip(1)) {
            if a.0 >= b.0 {
                return Err(format!("sample of {} ns is followed by {} ns", a.0, b.0));
            }
        }
        match self.samples.iter().find(|s| !is_rigid(&s.1)) {
            Some(sample) => Err(format!("pose of {} ns is not rigid", sample.0)),
            None => Ok(()),
        }
    }
}

/// Converts seconds to nanoseconds: at least 0, saturating, 0 for NaN.
pub(super) fn duration_ns(seconds: f64) -> i64 {
    (seconds * 1.0e9).round().max(0.0) as i64
}
