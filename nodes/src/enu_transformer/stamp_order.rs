//! Stamp order of a stream: distinguishes late items from a clock step.

use std::collections::VecDeque;

/// Window of late items: an item older than this relative to the newest belongs to a stepped clock.
const WINDOW_NS: i64 = 1_000_000_000;
/// Consecutive items that must agree on another time before it is accepted.
const AGREEING: usize = 3;
/// Limit of stored items since the newest: [`WINDOW_NS`] of a stream at 1 kHz.
const MAX_SINCE_NEWEST: usize = 1024;
/// Largest and smallest number of stamps stored for the period of the stream.
const MAX_RECENT: usize = 1024;
const MIN_RECENT: usize = 16;
/// Number of gaps needed for a period.
const MIN_GAPS: usize = 4;

/// Decision on an item of a stream.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Decision<T> {
    /// Accepted items with their stamps, in the order of time.
    pub taken: Vec<(i64, T)>,
    /// True after a clock step: everything before `taken` has another time base.
    pub is_clock_set: bool,
    /// Rejected items.
    pub refused: Vec<Refused>,
}

/// Reason for rejecting an item.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refused {
    /// Duplicate of the newest stamp.
    SameStamp {
        /// Nanoseconds since the Unix epoch.
        stamp_ns: i64,
    },
    /// Stamp without agreeing neighbours.
    Alone {
        /// Nanoseconds since the Unix epoch.
        stamp_ns: i64,
        /// Newest stamp of the stream at that time.
        newest_ns: i64,
    },
}

impl Refused {
    /// True if the stamp may be of the stream's clock.
    pub fn is_near(&self) -> bool {
        match *self {
            Self::SameStamp { .. } => true,
            Self::Alone {
                stamp_ns,
                newest_ns,
            } => stamp_ns.abs_diff(newest_ns) <= WINDOW_NS.unsigned_abs(),
        }
    }
}

/// Stamp order of a stream.
///
/// An item older than the newest is late if it lies in a gap of the stream; it is inserted in order. An item is held if
/// it lies between consecutive stamps without a gap, is more than a second older, or ahead by more than the limit.
/// Three held items without an item of the stream's time between them are a clock step, and all items since the newest
/// are returned. Otherwise held items are rejected.
#[derive(Clone, Debug)]
pub(crate) struct StampOrder<T> {
    ahead_ns: i64,
    /// Accepted stamps, ascending, back to [`WINDOW_NS`] and [`MIN_RECENT`].
    recent: VecDeque<i64>,
    /// Items since the newest, in the order of arrival, late ones included.
    since: Vec<(i64, T)>,
    /// Stamps of the held items among them.
    held: Vec<i64>,
    /// Greatest delay of a late item, and its stamp.
    latest: Option<(i64, i64)>,
}

impl<T: Clone> StampOrder<T> {
    /// Order of a stream with at most `ahead_ns` between consecutive items.
    pub fn new(ahead_ns: i64) -> Self {
        Self {
            ahead_ns,
            recent: VecDeque::new(),
            since: Vec::new(),
            held: Vec::new(),
            latest: None,
        }
    }

    /// Newest stamp of the stream.
    pub fn newest_ns(&self) -> Option<i64> {
        self.recent.back().copied()
    }

    /// True while items are held: a clock step is undecided.
    pub fn is_open(&self) -> bool {
        !self.held.is_empty()
    }

    /// True while an undecided clock step is so small that stamps before and after it overlap.
    pub fn is_ambiguous(&self) -> bool {
        let newest_ns = self.newest_ns().unwrap_or(0);
        let mut held = self.held.iter();
        held.any(|stamp_ns| stamp_ns.abs_diff(newest_ns) <= WINDOW_NS.unsigned_abs())
    }

    /// Largest delay of late items within the last `memory_ns`.
    pub fn delay_ns(&self, memory_ns: i64) -> i64 {
        let newest_ns = self.recent.back().copied().unwrap_or(0);
        let latest = self
            .latest
            .filter(|(_, stamp_ns)| newest_ns.saturating_sub(*stamp_ns) <= memory_ns);
        latest.map_or(0, |(delay_ns, _)| delay_ns)
    }

    /// Handles the next item.
    pub fn push(&mut self, stamp_ns: i64, item: T) -> Decision<T> {
        let Some(&newest_ns) = self.recent.back() else {
            self.note(stamp_ns);
            return taken(stamp_ns, item);
        };
        let step_ns = stamp_ns.saturating_sub(newest_ns);
        if step_ns > 0 && step_ns <= self.ahead_ns {
            let refused = self.refuse_held(newest_ns);
            self.since.clear();
            self.note(stamp_ns);
            return Decision {
                refused,
                ..taken(stamp_ns, item)
            };
        }
        if step_ns == 0 {
            return refused(vec![Refused::SameStamp { stamp_ns }]);
        }
        if self.since.len() < MAX_SINCE_NEWEST {
            self.since.push((stamp_ns, item.clone()));
        }
        if (-WINDOW_NS..0).contains(&step_ns) && self.fills_hole(stamp_ns) {
            let delay_ns = -step_ns;
            if self.delay_ns(self.ahead_ns) <= delay_ns {
                self.latest = Some((delay_ns, stamp_ns));
            }
            self.note(stamp_ns);
            return taken(stamp_ns, item);
        }
        self.hold(stamp_ns, newest_ns)
    }

    /// Ends the stream: held items are rejected.
    pub fn finish(&mut self) -> Vec<Refused> {
        let newest_ns = self.recent.back().copied().unwrap_or(0);
        self.since.clear();
        self.refuse_held(newest_ns)
    }

    fn hold(&mut self, stamp_ns: i64, newest_ns: i64) -> Decision<T> {
        // After a small step the new time continues; after a jump, items agree within steps small against it, as
        // those of a slow sensor.
        let is_near = stamp_ns.abs_diff(newest_ns) <= WINDOW_NS.unsigned_abs();
        let agrees = |last_ns: &i64| match is_near {
            true => stamp_ns > *last_ns,
            false => stamp_ns.abs_diff(*last_ns) < stamp_ns.abs_diff(newest_ns),
        };
        let mut gone = Vec::new();
        if !self.held.last().is_none_or(agrees) {
            gone = self.refuse_held(newest_ns);
            let item = self.since.pop();
            self.since.clear();
            self.since.extend(item);
        }
        self.held.push(stamp_ns);
        if self.held.len() < AGREEING {
            return refused(gone);
        }
        self.held.clear();
        self.recent.clear();
        self.latest = None;
        let mut items = std::mem::take(&mut self.since);
        items.sort_by_key(|(stamp_ns, _)| *stamp_ns);
        items.dedup_by_key(|(stamp_ns, _)| *stamp_ns);
        for (stamp_ns, _) in &items {
            self.note(*stamp_ns);
        }
        Decision {
            taken: items,
            is_clock_set: true,
            refused: gone,
        }
    }

    fn refuse_held(&mut self, newest_ns: i64) -> Vec<Refused> {
        let alone = |stamp_ns| Refused::Alone {
            stamp_ns,
            newest_ns,
        };
        self.held.drain(..).map(alone).collect()
    }

    /// True if the stream has a hole at a stamp, by its period.
    fn fills_hole(&self, stamp_ns: i64) -> bool {
        let next = self.recent.partition_point(|s| *s < stamp_ns);
        if self.recent.get(next) == Some(&stamp_ns) {
            return false;
        }
        let (before, after) = (
            next.checked_sub(1).and_then(|i| self.recent.get(i)),
            self.recent.get(next),
        );
        let (Some(before_ns), Some(after_ns)) = (before, after) else {
            // Older than all: unknown while the stream begins.
            return self.recent.len() < MIN_RECENT;
        };
        let pairs = self.recent.iter().zip(self.recent.iter().skip(1));
        let mut gaps_ns: Vec<i64> = pairs.map(|(a, b)| b.saturating_sub(*a)).collect();
        if gaps_ns.len() < MIN_GAPS {
            return true;
        }
        // The lower quartile: holes make some gaps longer, nothing makes them shorter.
        let quarter = gaps_ns.len() / 4;
        let period_ns = *gaps_ns.select_nth_unstable(quarter).1;
        after_ns.saturating_sub(*before_ns) > period_ns.saturating_add(period_ns / 2)
    }

    fn note(&mut self, stamp_ns: i64) {
        let at = self.recent.partition_point(|s| *s < stamp_ns);
        self.recent.insert(at, stamp_ns);
        let horizon_ns = self
            .recent
            .back()
            .map_or(0, |newest| newest.saturating_sub(2 * WINDOW_NS));
        let is_old = |recent: &VecDeque<i64>| {
            recent.len() > MIN_RECENT && recent.front().is_some_and(|oldest| *oldest < horizon_ns)
        };
        while self.recent.len() > MAX_RECENT || is_old(&self.recent) {
            self.recent.pop_front();
        }
    }
}

fn taken<T>(stamp_ns: i64, item: T) -> Decision<T> {
    Decision {
        taken: vec![(stamp_ns, item)],
        is_clock_set: false,
        refused: Vec::new(),
    }
}

fn refused<T>(refused: Vec<Refused>) -> Decision<T> {
    Decision {
        taken: Vec::new(),
        is_clock_set: false,
        refused,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;
    const AHEAD_NS: i64 = 10_000 * MS;

    /// Stamps taken in their order, stamps after which the clock was found set, and refusals.
    fn pass(stamps_ms: &[i64]) -> (Vec<i64>, Vec<i64>, usize) {
        let mut order = StampOrder::new(AHEAD_NS);
        let (mut all, mut set, mut refused) = (Vec::new(), Vec::new(), 0);
        for &stamp in stamps_ms {
            let decision = order.push(stamp * MS, stamp);
            if decision.is_clock_set {
                all.clear();
                set.push(stamp);
            }
            for (stamp_ns, item) in decision.taken {
                assert_eq!(stamp_ns, item * MS);
                all.push(item);
            }
            refused += decision.refused.len();
        }
        refused += order.finish().len();
        (all, set, refused)
    }

    /// Stamps of `period` ms with one in `every` delayed by some of the following.
    fn jittered(count: i64, period: i64, delay: i64) -> Vec<i64> {
        let mut arrivals: Vec<(i64, i64)> = (0..count)
            .map(|i| (i * period + (i * i * 31 + i * 17) % (delay + 1), i * period))
            .collect();
        arrivals.sort_unstable();
        arrivals.into_iter().map(|(_, stamp)| stamp).collect()
    }

    #[test]
    fn late_items_find_their_place_and_are_no_step() {
        for (period, delay) in [(10, 50), (10, 15), (5, 200), (20, 100), (100, 400)] {
            let stamps = jittered(200, period, delay);
            assert!(!stamps.is_sorted());
            let (mut taken, set, refused) = pass(&stamps);
            taken.sort_unstable();
            let expected: Vec<i64> = (0..200).map(|i| i * period).collect();
            assert_eq!(taken, expected, "{period} ms, {delay} ms late");
            assert_eq!((set, refused), (vec![], 0), "{period} ms, {delay} ms late");
        }
    }

    #[test]
    fn the_delay_of_late_items_is_known_for_a_while() {
        let mut order = StampOrder::new(AHEAD_NS);
        for stamp in [0, 10, 20, 30, 40, 60, 70, 80, 50] {
            order.push(stamp * MS, ());
        }
        assert_eq!(order.delay_ns(AHEAD_NS), 30 * MS);
        order.push(90 * MS, ());
        assert_eq!(order.delay_ns(20 * MS), 0);
    }

    #[test]
    fn a_clock_set_by_any_step_loses_no_item() {
        // By whole periods and between them.
        for step in [-40, -103, -503, -990, -1013, -60_000, 60_000] {
            let before: Vec<i64> = (0..100).map(|i| 100_000 + 10 * i).collect();
            let after: Vec<i64> = (0..200).map(|i| 101_000 + step + 10 * i).collect();
            let (taken, set, refused) = pass(&[before, after.clone()].concat());
            assert_eq!(taken, after, "{step} ms");
            assert_eq!((set, refused), (vec![after[2]], 0), "{step} ms");
        }
    }

    #[test]
    fn single_stamps_of_another_time_are_refused() {
        let mut stamps = Vec::new();
        for i in 0..100 {
            stamps.push(100_000 + 10 * i);
            if i % 7 == 0 {
                let newest = 100_000 + 10 * i;
                // Half a second back is not told from a late item while the stream begins.
                let back = if i < 20 { 0 } else { newest - 505 };
                stamps.push([0, 1 << 40, back, newest][(i as usize / 7) % 4]);
            }
        }
        let (taken, set, refused) = pass(&stamps);
        assert_eq!(
            taken,
            (0..100).map(|i| 100_000 + 10 * i).collect::<Vec<_>>()
        );
        assert_eq!((set, refused), (vec![], 15));
    }

    #[test]
    fn extreme_stamps_do_not_overflow() {
        let mut order = StampOrder::new(i64::MAX);
        for stamp in [
            i64::MIN,
            i64::MAX,
            0,
            i64::MIN,
            -1,
            i64::MAX,
            1,
            1,
            2,
            i64::MIN + 1,
        ] {
            order.push(stamp, ());
        }
    }
}
