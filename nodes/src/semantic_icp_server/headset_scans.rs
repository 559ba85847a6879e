//! Clouds of one session for the next search.

use std::collections::VecDeque;
use std::sync::Arc;

use lattice_core::registration::SourceCloud;

/// Bounded list of clouds, the newest last.
pub(super) struct HeadsetScans {
    kept: VecDeque<Kept>,
    max: usize,
    period_ns: i64,
}

struct Kept {
    headset_scan: Arc<SourceCloud>,
    /// Time of the first cloud that this one replaced.
    since_ns: i64,
    stamp_ns: i64,
}

impl HeadsetScans {
    pub fn new(max: usize, period_ns: i64) -> Self {
        Self {
            kept: VecDeque::new(),
            max: max.max(1),
            period_ns,
        }
    }

    /// Changes the bounds.
    pub fn set_bounds(&mut self, max: usize, period_ns: i64) {
        (self.max, self.period_ns) = (max.max(1), period_ns);
        while self.kept.len() > self.max {
            self.kept.pop_front();
        }
    }

    /// Adds a cloud. It replaces the newest one within the period, and the oldest
    /// one above the limit, so that a slowly turning headset contributes several views.
    pub fn push(&mut self, headset_scan: Arc<SourceCloud>, stamp_ns: i64, now_ns: i64) {
        let mut since_ns = now_ns;
        if let Some(newest) = self.kept.back()
            && now_ns.saturating_sub(newest.since_ns) < self.period_ns
        {
            since_ns = newest.since_ns;
            self.kept.pop_back();
        }
        self.add(headset_scan, stamp_ns, since_ns);
    }

    /// Adds a cloud; drops the oldest above the limit.
    pub fn add(&mut self, headset_scan: Arc<SourceCloud>, stamp_ns: i64, since_ns: i64) {
        if self.kept.len() >= self.max {
            self.kept.pop_front();
        }
        self.kept.push_back(Kept {
            headset_scan,
            since_ns,
            stamp_ns,
        });
    }

    pub fn clear(&mut self) {
        self.kept.clear();
    }

    /// Drops the given scans.
    pub fn remove(&mut self, headset_scans: &[Arc<SourceCloud>]) {
        let is_one = |kept: &Kept| {
            headset_scans
                .iter()
                .any(|headset_scan| Arc::ptr_eq(headset_scan, &kept.headset_scan))
        };
        self.kept.retain(|kept| !is_one(kept));
    }

    pub fn all(&self) -> Vec<Arc<SourceCloud>> {
        self.kept
            .iter()
            .map(|kept| Arc::clone(&kept.headset_scan))
            .collect()
    }

    pub fn is_empty(&self) -> bool {
        self.kept.is_empty()
    }

    pub fn len(&self) -> usize {
        self.kept.len()
    }

    /// Stamp of the newest cloud; 0 without any.
    pub fn stamp_ns(&self) -> i64 {
        self.kept.back().map_or(0, |kept| kept.stamp_ns)
    }
}
