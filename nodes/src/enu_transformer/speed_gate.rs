//! Speed check of positions.

use nalgebra::Vector3;

/// Tolerated distance between two positions in any time, m: receiver noise, and inaccurate stamps.
const SLACK_M: f64 = 1.0;
/// Number of positions that must agree on another place before it is accepted.
const AGREEING: usize = 3;
/// Limit of held positions.
const MAX_HELD: usize = 4096;

/// Position in an earth-fixed frame.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Placed<T> {
    /// Nanoseconds since the Unix epoch.
    pub stamp_ns: i64,
    /// Metres.
    pub position_m: Vector3<f64>,
    /// Fix or pose at this position.
    pub item: T,
}

/// Step of positions above the speed limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TooFast {
    /// Distance from the previous position, m.
    pub distance_m: f64,
    /// Time since the previous position, s.
    pub time_s: f64,
}

/// Decision on a position.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Passed<T> {
    /// Accepted items in the order of time.
    pub taken: Vec<Placed<T>>,
    /// Step to `taken`, if they are at another place that was held until now.
    pub jump: Option<TooFast>,
    /// Steps to rejected items.
    pub refused: Vec<TooFast>,
}

/// Holds unreachable positions until a reachable one shows that
/// they are wrong, or until enough of them have agreed for long enough.
#[derive(Clone, Debug)]
pub(super) struct SpeedGate<T> {
    max_speed_m_per_s: f64,
    settle_ns: i64,
    last: Option<(i64, Vector3<f64>)>,
    held: Vec<Placed<T>>,
    /// Step to the first held position.
    jump: Option<TooFast>,
}

impl<T> SpeedGate<T> {
    /// Gate for a speed in m/s; another place is accepted after `settle_ns` nanoseconds.
    pub fn new(max_speed_m_per_s: f64, settle_ns: i64) -> Self {
        Self {
            max_speed_m_per_s,
            settle_ns,
            last: None,
            held: Vec::new(),
            jump: None,
        }
    }

    /// Largest accepted speed, m/s.
    pub fn max_speed_m_per_s(&self) -> f64 {
        self.max_speed_m_per_s
    }

    /// Handles the next position, whose coordinates are finite.
    pub fn push(&mut self, placed: Placed<T>) -> Passed<T> {
        let mut refused = Vec::new();
        let Some(last) = self.last else {
            return self.take(placed, refused);
        };
        let at = (placed.stamp_ns, placed.position_m);
        let step = step_between(&last, &at);
        let held = self
            .held
            .last()
            .map(|held| (held.stamp_ns, held.position_m));
        let is_with_held = held.is_some_and(|held| {
            let from_held = step_between(&held, &at);
            self.is_possible(&from_held) && from_held.distance_m < step.distance_m
        });
        if !is_with_held {
            refused = self.refuse_held();
            if self.is_possible(&step) {
                return self.take(placed, refused);
            }
        }
        self.jump.get_or_insert(step);
        self.held.push(placed);
        let span_ns = match (self.held.first(), self.held.last()) {
            (Some(first), Some(last)) => last.stamp_ns.saturating_sub(first.stamp_ns),
            _ => 0,
        };
        let agree = self.held.len() >= AGREEING && span_ns >= self.settle_ns;
        if !agree && self.held.len() < MAX_HELD {
            return Passed {
                taken: Vec::new(),
                jump: None,
                refused,
            };
        }
        let taken = std::mem::take(&mut self.held);
        self.last = taken
            .last()
            .map(|placed| (placed.stamp_ns, placed.position_m));
        Passed {
            taken,
            jump: self.jump.take(),
            refused,
        }
    }

    /// Rejects held positions.
    pub fn refuse_held(&mut self) -> Vec<TooFast> {
        let jump = self.jump.take();
        self.held.drain(..).filter_map(|_| jump).collect()
    }

    /// Drops all positions.
    pub fn clear(&mut self) {
        self.last = None;
        self.held.clear();
        self.jump = None;
    }

    fn take(&mut self, placed: Placed<T>, refused: Vec<TooFast>) -> Passed<T> {
        // A late position is not the current one.
        if self
            .last
            .is_none_or(|(stamp_ns, _)| placed.stamp_ns >= stamp_ns)
        {
            self.last = Some((placed.stamp_ns, placed.position_m));
        }
        Passed {
            taken: vec![placed],
            jump: None,
            refused,
        }
    }

    fn is_possible(&self, step: &TooFast) -> bool {
        step.distance_m <= self.max_speed_m_per_s * step.time_s + SLACK_M
    }
}

fn step_between(from: &(i64, Vector3<f64>), to: &(i64, Vector3<f64>)) -> TooFast {
    TooFast {
        distance_m: (to.1 - from.1).norm(),
        time_s: to.0.abs_diff(from.0) as f64 * 1e-9,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers of the items taken, numbers at which a jump was believed, and refusals, of positions east
    /// at 10 Hz.
    fn pass(east_m: &[f64]) -> (Vec<usize>, Vec<usize>, usize) {
        let mut gate = SpeedGate::new(50.0, 500_000_000);
        let (mut taken, mut jumps, mut refused) = (Vec::new(), Vec::new(), 0);
        for (i, east_m) in east_m.iter().enumerate() {
            let passed = gate.push(Placed {
                stamp_ns: i as i64 * 100_000_000,
                position_m: Vector3::new(*east_m, 0.0, 0.0),
                item: i,
            });
            taken.extend(passed.taken.iter().map(|placed| placed.item));
            jumps.extend(passed.jump.map(|_| i));
            refused += passed.refused.len();
        }
        refused += gate.refuse_held().len();
        (taken, jumps, refused)
    }

    #[test]
    fn a_drive_passes_and_what_is_off_for_a_moment_does_not() {
        let drive: Vec<f64> = (0..30).map(|i| f64::from(i) * 4.0).collect();
        assert_eq!(pass(&drive), ((0..30).collect(), vec![], 0));
        for wrong in [1, 4] {
            let mut off = drive.clone();
            off.iter_mut().skip(10).take(wrong).for_each(|x| *x += 60.0);
            let expected = (0..30).filter(|i| !(10..10 + wrong).contains(i)).collect();
            assert_eq!(pass(&off), (expected, vec![], wrong));
        }
    }

    #[test]
    fn another_place_is_believed_when_it_lasts_and_nothing_of_it_is_lost() {
        let mut moved: Vec<f64> = (0..40).map(f64::from).collect();
        moved.iter_mut().skip(20).for_each(|x| *x += 1000.0);
        assert_eq!(pass(&moved), ((0..40).collect(), vec![25], 0));
        // Two wrong places after each other agree on none.
        moved.iter_mut().skip(22).for_each(|x| *x += 1000.0);
        let expected = (0..40).filter(|i| *i != 20 && *i != 21).collect();
        assert_eq!(pass(&moved), (expected, vec![27], 2));
    }
}
