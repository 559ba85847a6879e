//! Mapping between the caller's clock and bag time.

/// Line through (playback time, bag time) with the rate as its slope; all times in ns.
#[derive(Clone, Copy, Debug)]
pub(super) struct Timeline {
    playback_ns: i64,
    bag_ns: i64,
    rate: f64,
}

impl Timeline {
    pub(super) fn new(bag_ns: i64, rate: f64) -> Timeline {
        Timeline {
            playback_ns: 0,
            bag_ns,
            rate,
        }
    }

    /// Playback time of the bag time `bag_ns`.
    pub(super) fn playback_at(&self, bag_ns: i64) -> i64 {
        let ahead_ns = bag_ns.saturating_sub(self.bag_ns);
        self.playback_ns
            .saturating_add(scaled(ahead_ns, self.rate.recip()))
    }

    /// Bag time at the playback time `playback_ns`.
    pub(super) fn bag_at(&self, playback_ns: i64) -> i64 {
        let ahead_ns = playback_ns.saturating_sub(self.playback_ns);
        self.bag_ns.saturating_add(scaled(ahead_ns, self.rate))
    }

    pub(super) fn rate(&self) -> f64 {
        self.rate
    }

    /// Changes the rate from `playback_ns` on.
    pub(super) fn set_rate(&mut self, playback_ns: i64, rate: f64) {
        self.anchor(playback_ns, self.bag_at(playback_ns));
        self.rate = rate;
    }

    /// Sets the line through this pair.
    pub(super) fn anchor(&mut self, playback_ns: i64, bag_ns: i64) {
        self.playback_ns = playback_ns;
        self.bag_ns = bag_ns;
    }
}

/// Scaled duration, exact at factor 1; otherwise rounded, saturating.
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
    fn nanoseconds_since_1970_stay_exact_at_rate_1() {
        let line = Timeline::new(1_299_999_999_950_000_128, 1.0);
        assert_eq!(line.playback_at(1_300_000_000_000_000_129), 50_000_001);
        assert_eq!(line.bag_at(i64::MAX), i64::MAX);
    }
}
