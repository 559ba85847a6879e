//! Buffer of timed poses of a machine.

use nalgebra::Isometry3;

use super::interpolate::is_rigid;
pub use super::pose_miss::PoseMiss;
use super::track::{Track, duration_ns};

/// Pose of base_link in the map at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StampedPose {
    /// Time, nanoseconds since the Unix epoch.
    pub stamp_ns: i64,
    /// Transform from base_link to the map frame, metres.
    pub map_from_base: Isometry3<f64>,
}

/// Bounds of a [`PoseBuffer`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseBufferOptions {
    /// Maximum age of a kept pose relative to the newest one, seconds.
    pub span_s: f64,
    /// Maximum time between two interpolated poses, seconds.
    pub max_gap_s: f64,
    /// Maximum number of poses, at least 2.
    pub max_poses: usize,
    /// Time step backwards from which a pose resets the buffer, seconds.
    pub jump_back_s: f64,
}

impl Default for PoseBufferOptions {
    fn default() -> PoseBufferOptions {
        PoseBufferOptions {
            span_s: 10.0,
            max_gap_s: 0.2,
            max_poses: 10_000,
            jump_back_s: 1.0,
        }
    }
}

/// Outcome of pushing a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PushOutcome {
    /// The pose was kept.
    Accepted,
    /// Time jumped back: earlier poses were dropped, this one was kept.
    JumpedBack,
    /// Refused: not newer than the newest pose.
    OutOfOrder,
    /// Refused: not finite, or not a rotation.
    NotFinite,
}

/// Recent poses of a machine, by time.
///
/// ```
/// use lattice_core::nalgebra::Isometry3;
/// use lattice_core::pose::{PoseBuffer, PoseBufferOptions, PoseMiss, StampedPose};
///
/// let mut buffer = PoseBuffer::new(PoseBufferOptions::default());
/// for (stamp_ns, x) in [(0, 0.0), (100_000_000, 1.0)] {
///     let map_from_base = Isometry3::translation(x, 0.0, 0.0);
///     buffer.push(StampedPose { stamp_ns, map_from_base });
/// }
/// assert_eq!(buffer.at(50_000_000)?.translation.x, 0.5);
/// assert!(matches!(buffer.at(100_000_001), Err(PoseMiss::AfterEnd { by_ns: 1 })));
/// # Ok::<(), PoseMiss>(())
/// ```
#[derive(Clone, Debug)]
pub struct PoseBuffer {
    track: Track,
    span_ns: i64,
    max_gap_ns: i64,
    max_poses: usize,
    jump_back_ns: i64,
}

impl PoseBuffer {
    /// Creates an empty buffer; negative or NaN durations count as zero.
    pub fn new(options: PoseBufferOptions) -> PoseBuffer {
        PoseBuffer {
            track: Track::default(),
            span_ns: duration_ns(options.span_s),
            max_gap_ns: duration_ns(options.max_gap_s),
            max_poses: options.max_poses.max(2),
            jump_back_ns: duration_ns(options.jump_back_s),
        }
    }

    /// Sets the maximum interpolation gap, seconds.
    pub fn set_max_gap_s(&mut self, max_gap_s: f64) {
        self.max_gap_ns = duration_ns(max_gap_s);
    }

    /// Appends a pose and drops those out of bounds.
    pub fn push(&mut self, pose: StampedPose) -> PushOutcome {
        if !is_rigid(&pose.map_from_base) {
            return PushOutcome::NotFinite;
        }
        let outcome = match self.track.newest_ns() {
            Some(newest_ns) if pose.stamp_ns <= newest_ns => {
                if newest_ns.saturating_sub(pose.stamp_ns) <= self.jump_back_ns {
                    return PushOutcome::OutOfOrder;
                }
                self.track.clear();
                PushOutcome::JumpedBack
            }
            _ => PushOutcome::Accepted,
        };
        self.track.insert(pose.stamp_ns, pose.map_from_base);
        self.track.trim(self.span_ns, self.max_poses);
        outcome
    }

    /// Inserts a pose in time order, however old; one with an existing time is [`PushOutcome::OutOfOrder`].
    pub fn insert(&mut self, pose: StampedPose) -> PushOutcome {
        if !is_rigid(&pose.map_from_base) {
            return PushOutcome::NotFinite;
        }
        if !self.track.insert(pose.stamp_ns, pose.map_from_base) {
            return PushOutcome::OutOfOrder;
        }
        self.track.trim(self.span_ns, self.max_poses);
        PushOutcome::Accepted
    }

    /// `map_from_base` at a time: exact at a pose, else linear interpolation and slerp; no extrapolation, and no
    /// interpolation over a gap.
    pub fn at(&self, stamp_ns: i64) -> Result<Isometry3<f64>, PoseMiss> {
        self.track.at(stamp_ns, self.max_gap_ns)
    }

    /// Poses between two times (exclusive), in order.
    pub fn between(&self, after_ns: i64, before_ns: i64) -> impl Iterator<Item = StampedPose> {
        let samples = self.track.between(after_ns, before_ns);
        samples.map(|&(stamp_ns, map_from_base)| StampedPose {
            stamp_ns,
            map_from_base,
        })
    }

    /// Time of the newest pose, nanoseconds.
    pub fn newest_ns(&self) -> Option<i64> {
        self.track.newest_ns()
    }

    /// Time of the oldest pose, nanoseconds.
    pub fn oldest_ns(&self) -> Option<i64> {
        self.track.oldest_ns()
    }

    /// Number of poses.
    pub fn len(&self) -> usize {
        self.track.len()
    }

    /// Tests whether the buffer is empty.
    pub fn is_empty(&self) -> bool {
        self.track.len() == 0
    }

    /// Drops all poses.
    pub fn clear(&mut self) {
        self.track.clear();
    }

    /// Validates the order, the bounds and the poses; for tests.
    pub fn validate(&self) -> Result<(), String> {
        if let (Some(oldest), Some(newest)) = (self.oldest_ns(), self.newest_ns())
            && newest.saturating_sub(oldest) > self.span_ns
        {
            return Err(format!(
                "poses from {oldest} to {newest} ns exceed the span"
            ));
        }
        self.track.validate(self.max_poses)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Quaternion, Unit};

    const SECOND: i64 = 1_000_000_000;

    fn at_x(stamp_ns: i64, x: f64) -> StampedPose {
        StampedPose {
            stamp_ns,
            map_from_base: Isometry3::translation(x, 0.0, 0.0),
        }
    }

    fn filled(stamps_ns: &[i64]) -> PoseBuffer {
        let mut buffer = PoseBuffer::new(PoseBufferOptions::default());
        for &stamp_ns in stamps_ns {
            let outcome = buffer.push(at_x(stamp_ns, stamp_ns as f64));
            assert_eq!(outcome, PushOutcome::Accepted);
        }
        buffer
    }

    #[test]
    fn poses_between_two_times_exclude_both() {
        let buffer = filled(&[0, 10, 20, 30]);
        let between = |after, before| -> Vec<i64> {
            buffer.between(after, before).map(|p| p.stamp_ns).collect()
        };
        assert_eq!(between(0, 30), [10, 20]);
        assert_eq!(between(-5, 11), [0, 10]);
        assert_eq!(between(30, 5), []);
    }

    #[test]
    fn a_gap_is_not_bridged_but_its_ends_are_there() {
        assert_eq!(filled(&[]).at(0), Err(PoseMiss::Empty));
        let buffer = filled(&[0, 5 * SECOND]);
        let miss = buffer.at(SECOND).unwrap_err().to_string();
        let expected = "poses around the time are 5.000000 s apart, over 0.200000 s";
        assert_eq!(miss, expected);
        assert!(buffer.at(0).is_ok() && buffer.at(5 * SECOND).is_ok());
    }

    #[test]
    fn time_set_back_starts_anew() {
        let mut buffer = filled(&[10 * SECOND, 11 * SECOND]);
        let mut push = |stamp_ns, x| buffer.push(at_x(stamp_ns, x));
        assert_eq!(push(10 * SECOND, 0.0), PushOutcome::OutOfOrder);
        assert_eq!(push(10 * SECOND - 1, 7.0), PushOutcome::JumpedBack);
        assert_eq!(buffer.len(), 1);
        assert_eq!(buffer.at(10 * SECOND - 1).unwrap().translation.x, 7.0);
        let by_ns = SECOND + 1;
        assert_eq!(buffer.at(11 * SECOND), Err(PoseMiss::AfterEnd { by_ns }));
    }

    #[test]
    fn late_poses_find_their_place() {
        let mut buffer = filled(&[0, 20, 30]);
        assert_eq!(buffer.insert(at_x(10, 10.0)), PushOutcome::Accepted);
        assert_eq!(buffer.insert(at_x(20, 7.0)), PushOutcome::OutOfOrder);
        assert_eq!(buffer.insert(at_x(40, f64::NAN)), PushOutcome::NotFinite);
        let x = |at| buffer.at(at).unwrap().translation.x;
        assert_eq!([0, 10, 15, 20, 30].map(x), [0.0, 10.0, 15.0, 20.0, 30.0]);
        assert_eq!(buffer.validate(), Ok(()));
    }

    #[test]
    fn memory_is_bounded_by_age_and_number() {
        let mut buffer = filled(&[0, SECOND, 9 * SECOND, 10 * SECOND]);
        buffer.push(at_x(11 * SECOND, 0.0));
        assert_eq!(buffer.oldest_ns(), Some(SECOND));
        let mut few = PoseBuffer::new(PoseBufferOptions {
            max_poses: 3,
            ..PoseBufferOptions::default()
        });
        for i in 0..100 {
            few.push(at_x(i, 0.0));
        }
        assert_eq!((few.len(), few.oldest_ns()), (3, Some(97)));
    }

    #[test]
    fn broken_poses_are_refused() {
        let mut buffer = filled(&[0]);
        let mut push = |quaternion, x| {
            let mut bad = at_x(1, x);
            bad.map_from_base.rotation = Unit::new_unchecked(quaternion);
            buffer.push(bad)
        };
        let none = Quaternion::new(0.0, 0.0, 0.0, 0.0);
        for (quaternion, x) in [(Quaternion::identity(), f64::NAN), (none, 0.0)] {
            assert_eq!(push(quaternion, x), PushOutcome::NotFinite);
        }
        assert_eq!(push(none / 0.0, 0.0), PushOutcome::NotFinite);
        assert_eq!(buffer.len(), 1);
    }

    #[test]
    fn extreme_stamps_and_options() {
        let mut buffer = PoseBuffer::new(PoseBufferOptions {
            span_s: f64::INFINITY,
            max_gap_s: f64::NAN,
            max_poses: 0,
            jump_back_s: -1.0,
        });
        assert_eq!(buffer.push(at_x(i64::MIN, 0.0)), PushOutcome::Accepted);
        assert_eq!(buffer.push(at_x(-2, 0.0)), PushOutcome::Accepted);
        assert!(matches!(buffer.at(-3), Err(PoseMiss::Gap { .. })));
        assert_eq!(buffer.push(at_x(i64::MAX, 1.0)), PushOutcome::Accepted);
        let by_ns = i64::MAX;
        assert_eq!(buffer.at(i64::MIN), Err(PoseMiss::BeforeStart { by_ns }));
        assert_eq!(buffer.push(at_x(0, 1.0)), PushOutcome::JumpedBack);
        assert_eq!(buffer.validate(), Ok(()));
    }
}
