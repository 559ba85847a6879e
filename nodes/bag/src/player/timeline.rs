//! Relates the caller's clock to the time of the bag.

/// A line through (playback time, bag time) with the rate as its slope; all times in ns.
#[derive(Clone, Copy, Debug)]
pub(super) struct Timeline {
    playback_ns: i64,
    bag_ns: i64,
    rate: f64,
    paused: bool,
}

impl Timeline {
    pub(super) fn new(bag_ns: i64, rate: f64) -> Timeline {
        Timeline {
            playback_ns: 0,
            bag_ns,
            rate,
            paused: false,
        }
    }

    pub(super) fn rate(&self) -> f64 {
        self.rate
    }

    pub(super) fn is_paused(&self) -> bool {
        self.paused
    }

    /// When `bag_ns` is due, if nothing changes.
    pub(super) fn playback_at(&self, bag_ns: i64) -> i64 {
        let ahead_ns = bag_ns.saturating_sub(self.bag_ns);
        self.playback_ns
            .saturating_add(scaled(ahead_ns, self.rate.recip()))
    }

    /// The bag time at `playback_ns`; stands still while paused.
    pub(super) fn bag_at(&self, playback_ns: i64) -> i64 {
        if self.paused {
            return self.bag_ns;
        }
        let ahead_ns = playback_ns.saturating_sub(self.playback_ns);
        self.bag_ns.saturating_add(scaled(ahead_ns, self.rate))
    }

    pub(super) fn pause(&mut self, playback_ns: i64) {
        self.anchor(playback_ns, self.bag_at(playback_ns));
        self.paused = true;
    }

    pub(super) fn resume(&mut self, playback_ns: i64) {
        self.anchor(playback_ns, self.bag_at(playback_ns));
        self.paused = false;
    }

    pub(super) fn set_rate(&mut self, playback_ns: i64, rate: f64) {
        self.anchor(playback_ns, self.bag_at(playback_ns));
        self.rate = rate;
    }

    /// Lays the line anew through this pair.
    pub(super) fn anchor(&mut self, playback_ns: i64, bag_ns: i64) {
        self.playback_ns = playback_ns;
        self.bag_ns = bag_ns;
    }
}

/// Exact at factor 1; otherwise rounded, saturating.
fn scaled(ns: i64, factor: f64) -> i64 {
    if factor == 1.0 {
        return ns;
    }
    // A cast from float to integer saturates.
    (ns as f64 * factor).round() as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rate_changes_and_pauses_leave_no_jump() {
        let mut line = Timeline::new(1_000, 2.0);
        assert_eq!(line.playback_at(1_200), 100);
        assert_eq!(line.bag_at(100), 1_200);
        line.set_rate(100, 0.5);
        assert_eq!((line.bag_at(100), line.bag_at(300)), (1_200, 1_300));
        line.pause(300);
        assert_eq!((line.bag_at(300), line.bag_at(9_000)), (1_300, 1_300));
        line.resume(9_000);
        assert_eq!((line.bag_at(9_000), line.bag_at(9_100)), (1_300, 1_350));
        assert_eq!(line.playback_at(1_350), 9_100);
    }

    #[test]
    fn nanoseconds_since_1970_stay_exact_at_rate_1() {
        let line = Timeline::new(1_299_999_999_950_000_128, 1.0);
        assert_eq!(line.playback_at(1_300_000_000_000_000_129), 50_000_001);
        assert_eq!(line.bag_at(i64::MAX), i64::MAX);
    }
}
