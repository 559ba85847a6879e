//! Buffer of timed transforms from any number of publishers.

mod frames;
mod path;

use nalgebra::Isometry3;

use self::frames::{Frames, Link};
use super::frame_name::{bare, check_names, shown};
use super::interpolate::is_rigid;
use super::track::duration_ns;
use super::{PoseMiss, PushOutcome, TfInsertError, TfMiss};

/// Bounds of a [`TransformBuffer`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TransformBufferOptions {
    /// Maximum age of a kept transform relative to the newest of its frame, seconds.
    pub history_s: f64,
    /// Maximum time between two interpolated transforms, seconds.
    pub max_gap_s: f64,
    /// Maximum number of frames.
    pub max_frames: usize,
    /// Maximum number of transforms per frame, at least 2.
    pub max_samples: usize,
    /// Time step backwards from which a transform resets the history of its frame, seconds.
    pub jump_back_s: f64,
}

impl Default for TransformBufferOptions {
    fn default() -> TransformBufferOptions {
        TransformBufferOptions {
            history_s: 10.0,
            max_gap_s: 1.0,
            max_frames: 1_000,
            max_samples: 20_000,
            jump_back_s: 2.0,
        }
    }
}

/// Transforms of all frames by time, from `/tf` and `/tf_static`.
///
/// A frame may have several parents, so a wrong publisher does not displace the right one. A lookup takes the
/// shortest path, static transforms first. A full table drops the frame least recently updated, except those on the
/// path to [`keep`](Self::keep).
#[derive(Clone, Debug)]
pub struct TransformBuffer {
    frames: Frames,
    history_ns: i64,
    max_gap_ns: i64,
    jump_back_ns: i64,
    max_samples: usize,
}

impl TransformBuffer {
    /// Creates an empty buffer; negative or NaN durations count as zero.
    pub fn new(options: TransformBufferOptions) -> TransformBuffer {
        TransformBuffer {
            frames: Frames::new(options.max_frames),
            history_ns: duration_ns(options.history_s),
            max_gap_ns: duration_ns(options.max_gap_s),
            jump_back_ns: duration_ns(options.jump_back_s),
            max_samples: options.max_samples.max(2),
        }
    }

    /// Keeps a frame, and those between it and the first kept one, when the table is full.
    pub fn keep(&mut self, frame: &str) {
        self.frames.keep(bare(frame));
    }

    /// Inserts `parent_from_child` at a time; a static transform is valid at all times and replaces the previous one.
    ///
    /// A leading `/` of a name is ignored. Transforms of a frame may arrive in any order within its history; one with
    /// an existing time, or an older one, is [`PushOutcome::OutOfOrder`]. After [`PushOutcome::JumpedBack`] the
    /// history of that frame restarts. A parent that was a child of its new child becomes the parent.
    pub fn insert(
        &mut self,
        parent: &str,
        child: &str,
        stamp_ns: i64,
        parent_from_child: Isometry3<f64>,
        is_static: bool,
    ) -> Result<PushOutcome, TfInsertError> {
        let (parent, child) = (bare(parent), bare(child));
        check_names(parent, child)?;
        if !is_rigid(&parent_from_child) {
            return Err(TfInsertError::NotFinite {
                parent: parent.to_owned(),
                child: child.to_owned(),
            });
        }
        match self.frames.link(parent, child, is_static)? {
            Link::Static(transform) => {
                *transform = parent_from_child;
                Ok(PushOutcome::Accepted)
            }
            Link::Moving(track) => {
                let late_ns = track.newest_ns().map_or(0, |n| n.saturating_sub(stamp_ns));
                let outcome = if late_ns > self.jump_back_ns {
                    track.clear();
                    PushOutcome::JumpedBack
                } else if late_ns > self.history_ns {
                    return Ok(PushOutcome::OutOfOrder);
                } else {
                    PushOutcome::Accepted
                };
                if !track.insert(stamp_ns, parent_from_child) {
                    return Ok(PushOutcome::OutOfOrder);
                }
                track.trim(self.history_ns, self.max_samples);
                Ok(outcome)
            }
        }
    }

    /// `target_from_source` at a time, over the nearest common ancestor: exact at samples, else linear interpolation
    /// and slerp, no extrapolation.
    ///
    /// Of several errors, one that waiting cannot resolve is returned first.
    pub fn lookup(
        &self,
        target: &str,
        source: &str,
        stamp_ns: i64,
    ) -> Result<Isometry3<f64>, TfMiss> {
        let known = |name: &str| {
            let id = self.frames.find(bare(name));
            id.ok_or_else(|| TfMiss::UnknownFrame { frame: shown(name) })
        };
        let (target_id, source_id) = (known(target)?, known(source)?);
        let path = self.frames.path(target_id, source_id);
        let path = path.ok_or_else(|| TfMiss::Disconnected {
            from: shown(source),
            to: shown(target),
        })?;
        let by_target = self.compose(path.to_target(), stamp_ns);
        let by_source = self.compose(path.to_source(), stamp_ns);
        match (by_target, by_source) {
            (Ok(ancestor_from_target), Ok(ancestor_from_source)) => {
                Ok(ancestor_from_target.inv_mul(&ancestor_from_source))
            }
            (Err(a), Err(b)) => Err(if a.may_still_come() { b } else { a }),
            (Err(miss), Ok(_)) | (Ok(_), Err(miss)) => Err(miss),
        }
    }

    /// Product of transforms at a time, from the highest frame to the lowest.
    fn compose(
        &self,
        steps: impl Iterator<Item = (usize, usize)>,
        stamp_ns: i64,
    ) -> Result<Isometry3<f64>, TfMiss> {
        let mut sum = Isometry3::identity();
        let mut miss: Option<TfMiss> = None;
        for (frame, parent) in steps {
            match self.frames.claim(frame, parent) {
                Some(Link::Static(transform)) => sum *= transform,
                Some(Link::Moving(track)) => match track.at(stamp_ns, self.max_gap_ns) {
                    Ok(transform) => sum *= transform,
                    Err(cause) => {
                        if miss.as_ref().is_none_or(TfMiss::may_still_come) {
                            miss = Some(tf_miss(self.frames.name(frame), cause));
                        }
                    }
                },
                None => {}
            }
        }
        miss.map_or(Ok(sum), Err)
    }

    /// Tests whether a frame is known.
    pub fn contains(&self, frame: &str) -> bool {
        self.frames.find(bare(frame)).is_some()
    }

    /// Highest ancestor of a frame over static transforms only: the base of the machine that carries a sensor.
    ///
    /// The frame itself if it has no static parent, `None` if it is unknown.
    pub fn static_root(&self, frame: &str) -> Option<&str> {
        let id = self.frames.find(bare(frame))?;
        Some(self.frames.name(self.frames.static_root(id)))
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Tests whether there is no frame.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Drops the history of a dynamic frame in one of its parents; frames and static transforms stay.
    pub fn clear_link(&mut self, parent: &str, child: &str) {
        if let Some(track) = self.frames.track_mut(bare(parent), bare(child)) {
            track.clear();
        }
    }

    /// Validates names, links, bounds and samples; for tests.
    pub fn validate(&self) -> Result<(), String> {
        self.frames.validate(self.max_samples)
    }
}

fn tf_miss(frame: &str, cause: PoseMiss) -> TfMiss {
    let frame = shown(frame);
    match cause {
        PoseMiss::Empty => TfMiss::TooNew { frame, by_ns: 0 },
        PoseMiss::BeforeStart { by_ns } => TfMiss::TooOld { frame, by_ns },
        PoseMiss::AfterEnd { by_ns } => TfMiss::TooNew { frame, by_ns },
        PoseMiss::Gap { gap_ns, max_gap_ns } => TfMiss::Gap {
            frame,
            gap_ns,
            max_gap_ns,
        },
    }
}

#[cfg(test)]
mod tests;
