//! The clouds of one session that a search may use.

use std::collections::VecDeque;
use std::sync::Arc;

use lattice_core::registration::Gaze;

/// A bounded number of clouds, the newest last.
pub(super) struct Gazes {
    kept: VecDeque<Kept>,
    max: usize,
    period_ns: i64,
}

struct Kept {
    gaze: Arc<Gaze>,
    /// When the first of the clouds came that this one stands for.
    since_ns: i64,
    stamp_ns: i64,
}

impl Gazes {
    pub fn new(max: usize, period_ns: i64) -> Self {
        Self {
            kept: VecDeque::new(),
            max: max.max(1),
            period_ns,
        }
    }

    /// Adds a cloud; it replaces the newest if that has not been there for the period, and the oldest
    /// if there are too many. A headset that looks around slowly is seen from several sides.
    pub fn push(&mut self, gaze: Arc<Gaze>, stamp_ns: i64, now_ns: i64) {
        let mut since_ns = now_ns;
        if let Some(newest) = self.kept.back()
            && now_ns.saturating_sub(newest.since_ns) < self.period_ns
        {
            since_ns = newest.since_ns;
            self.kept.pop_back();
        }
        self.add(gaze, stamp_ns, since_ns);
    }

    /// Adds a cloud; the oldest goes if there are too many.
    pub fn add(&mut self, gaze: Arc<Gaze>, stamp_ns: i64, since_ns: i64) {
        if self.kept.len() >= self.max {
            self.kept.pop_front();
        }
        self.kept.push_back(Kept {
            gaze,
            since_ns,
            stamp_ns,
        });
    }

    pub fn clear(&mut self) {
        self.kept.clear();
    }

    /// Drops those.
    pub fn remove(&mut self, gazes: &[Arc<Gaze>]) {
        let is_one = |kept: &Kept| gazes.iter().any(|gaze| Arc::ptr_eq(gaze, &kept.gaze));
        self.kept.retain(|kept| !is_one(kept));
    }

    pub fn all(&self) -> Vec<Arc<Gaze>> {
        self.kept
            .iter()
            .map(|kept| Arc::clone(&kept.gaze))
            .collect()
    }

    pub fn is_empty(&self) -> bool {
        self.kept.is_empty()
    }

    /// Stamp of the newest; 0 without any.
    pub fn stamp_ns(&self) -> i64 {
        self.kept.back().map_or(0, |kept| kept.stamp_ns)
    }
}
