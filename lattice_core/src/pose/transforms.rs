//! The tree of frames.

use nalgebra::Isometry3;
use rustc_hash::FxHashMap;

use super::frame_name::{bare, check_names, shown};
use super::interpolate::is_rigid;
use super::track::{Track, duration_ns};
use super::{PoseMiss, PushOutcome, TfInsertError, TfMiss};

/// Bounds of a [`TransformBuffer`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TransformBufferOptions {
    /// Age against the newest of a frame up to which its transforms are kept, seconds.
    pub history_s: f64,
    /// Longest time between two transforms that is interpolated over, seconds.
    pub max_gap_s: f64,
    /// Most frames.
    pub max_frames: usize,
    /// Most transforms kept of a frame, at least 2.
    pub max_samples: usize,
    /// A transform older than the newest of its frame by more than this means that time was
    /// set back, seconds.
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

#[derive(Clone, Debug)]
struct Frame {
    name: String,
    /// The parent and the transform to it; a root has none.
    link: Option<(usize, Link)>,
}

#[derive(Clone, Debug)]
enum Link {
    Static(Isometry3<f64>),
    Moving(Track),
}

impl Link {
    fn kind(&self) -> &'static str {
        match self {
            Link::Static(_) => "static",
            Link::Moving(_) => "moving",
        }
    }
}

/// Transforms of all frames by time, as `/tf` and `/tf_static` give them.
#[derive(Clone, Debug)]
pub struct TransformBuffer {
    frames: Vec<Frame>,
    index: FxHashMap<String, usize>,
    history_ns: i64,
    max_gap_ns: i64,
    jump_back_ns: i64,
    max_frames: usize,
    max_samples: usize,
}

impl TransformBuffer {
    /// Empty buffer; negative or NaN durations count as zero.
    pub fn new(options: TransformBufferOptions) -> TransformBuffer {
        TransformBuffer {
            frames: Vec::new(),
            index: FxHashMap::default(),
            history_ns: duration_ns(options.history_s),
            max_gap_ns: duration_ns(options.max_gap_s),
            jump_back_ns: duration_ns(options.jump_back_s),
            max_frames: options.max_frames,
            max_samples: options.max_samples.max(2),
        }
    }

    /// Takes `parent_from_child` at a time; a static one holds at all times and replaces
    /// the one before. A leading `/` of a name is ignored.
    ///
    /// Transforms of a frame may come in any order within its history: a second one of the
    /// same time, or an older one, is [`PushOutcome::OutOfOrder`]. After
    /// [`PushOutcome::JumpedBack`] the history of that frame starts anew. Transforms that
    /// would break the tree are refused and change nothing.
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
        self.check_tree(parent, child, is_static)?;
        let parent_id = self.id(parent);
        let child_id = self.id(child);
        let (history_ns, jump_back_ns) = (self.history_ns, self.jump_back_ns);
        let max_samples = self.max_samples;
        let Some(frame) = self.frames.get_mut(child_id) else {
            return Ok(PushOutcome::OutOfOrder);
        };
        let (_, link) = frame.link.get_or_insert_with(|| {
            let link = match is_static {
                true => Link::Static(parent_from_child),
                false => Link::Moving(Track::default()),
            };
            (parent_id, link)
        });
        match link {
            Link::Static(transform) => {
                *transform = parent_from_child;
                Ok(PushOutcome::Accepted)
            }
            Link::Moving(track) => {
                let late_ns = track.newest_ns().map_or(0, |n| n.saturating_sub(stamp_ns));
                let outcome = if late_ns > jump_back_ns {
                    track.clear();
                    PushOutcome::JumpedBack
                } else if late_ns > history_ns {
                    return Ok(PushOutcome::OutOfOrder);
                } else {
                    PushOutcome::Accepted
                };
                if !track.insert(stamp_ns, parent_from_child) {
                    return Ok(PushOutcome::OutOfOrder);
                }
                track.trim(history_ns, max_samples);
                Ok(outcome)
            }
        }
    }

    /// `target_from_source` at a time, by way of the nearest common ancestor; exact at the
    /// samples of a moving frame, linear and slerp between them, nothing outside of them.
    ///
    /// Of several misses the one is reported that no waiting can heal.
    pub fn lookup(
        &self,
        target: &str,
        source: &str,
        stamp_ns: i64,
    ) -> Result<Isometry3<f64>, TfMiss> {
        let target_id = self.known(target)?;
        let source_id = self.known(source)?;
        let disconnected = || TfMiss::Disconnected {
            from: shown(source),
            to: shown(target),
        };
        let ancestor = self
            .common_ancestor(target_id, source_id)
            .ok_or_else(disconnected)?;
        let by_target = self.climb(target_id, ancestor, stamp_ns);
        let by_source = self.climb(source_id, ancestor, stamp_ns);
        match (by_target, by_source) {
            (Ok(ancestor_from_target), Ok(ancestor_from_source)) => {
                Ok(ancestor_from_target.inv_mul(&ancestor_from_source))
            }
            (Err(a), Err(b)) => Err(if a.may_still_come() { b } else { a }),
            (Err(miss), Ok(_)) | (Ok(_), Err(miss)) => Err(miss),
        }
    }

    /// True if some transform named the frame.
    pub fn contains(&self, frame: &str) -> bool {
        self.index.contains_key(bare(frame))
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// True if there is no frame.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// Forgets the history of all moving frames; the tree and static transforms stay.
    pub fn clear_moving(&mut self) {
        for frame in &mut self.frames {
            if let Some((_, Link::Moving(track))) = &mut frame.link {
                track.clear();
            }
        }
    }

    /// Checks names, links, bounds and samples; for tests.
    pub fn validate(&self) -> Result<(), String> {
        if self.frames.len() > self.max_frames || self.frames.len() != self.index.len() {
            return Err(format!(
                "{} frames, {} names, limit {}",
                self.frames.len(),
                self.index.len(),
                self.max_frames
            ));
        }
        for (id, frame) in self.frames.iter().enumerate() {
            if self.index.get(&frame.name) != Some(&id) {
                return Err(format!("frame '{}' is not found by name", frame.name));
            }
            if self.depth(id).is_none() {
                return Err(format!("frame '{}' is in a cycle", frame.name));
            }
            if let Some((_, Link::Moving(track))) = &frame.link {
                track
                    .validate(self.max_samples)
                    .map_err(|e| format!("frame '{}': {e}", frame.name))?;
            }
        }
        Ok(())
    }

    /// Refuses cycles, a second parent, a change of kind, and too many frames.
    fn check_tree(&self, parent: &str, child: &str, is_static: bool) -> Result<(), TfInsertError> {
        let cycle = || TfInsertError::Cycle {
            parent: parent.to_owned(),
            child: child.to_owned(),
        };
        if parent == child {
            return Err(cycle());
        }
        let parent_id = self.index.get(parent).copied();
        let child_id = self.index.get(child).copied();
        let new = usize::from(parent_id.is_none()) + usize::from(child_id.is_none());
        if self.frames.len().saturating_add(new) > self.max_frames {
            return Err(TfInsertError::TooManyFrames {
                parent: parent.to_owned(),
                child: child.to_owned(),
                max_frames: self.max_frames,
            });
        }
        let Some((child_id, frame)) = child_id.and_then(|id| Some((id, self.frames.get(id)?)))
        else {
            return Ok(());
        };
        if let Some((known_id, link)) = &frame.link {
            if parent_id != Some(*known_id) {
                return Err(TfInsertError::Reparented {
                    child: child.to_owned(),
                    parent: self.name(*known_id).to_owned(),
                    refused: parent.to_owned(),
                });
            }
            let refused = if is_static { "static" } else { "moving" };
            if link.kind() != refused {
                return Err(TfInsertError::KindChanged {
                    child: child.to_owned(),
                    known: link.kind(),
                    refused,
                });
            }
            return Ok(());
        }
        // The child is a root: a cycle arises only if the parent hangs below it.
        let mut above = parent_id;
        while let Some(id) = above {
            if id == child_id {
                return Err(cycle());
            }
            above = self.parent(id);
        }
        Ok(())
    }

    /// Number of a frame, new if need be; the caller has checked the limit.
    fn id(&mut self, name: &str) -> usize {
        if let Some(&id) = self.index.get(name) {
            return id;
        }
        let id = self.frames.len();
        self.frames.push(Frame {
            name: name.to_owned(),
            link: None,
        });
        self.index.insert(name.to_owned(), id);
        id
    }

    fn known(&self, name: &str) -> Result<usize, TfMiss> {
        self.index
            .get(bare(name))
            .copied()
            .ok_or_else(|| TfMiss::UnknownFrame { frame: shown(name) })
    }

    fn name(&self, id: usize) -> &str {
        self.frames.get(id).map_or("", |f| f.name.as_str())
    }

    fn parent(&self, id: usize) -> Option<usize> {
        self.frames
            .get(id)?
            .link
            .as_ref()
            .map(|(parent, _)| *parent)
    }

    /// Links from a frame to its root; `None` if there is no end to them.
    fn depth(&self, id: usize) -> Option<usize> {
        let mut at = id;
        for depth in 0..self.frames.len() {
            match self.parent(at) {
                None => return Some(depth),
                Some(parent) => at = parent,
            }
        }
        None
    }

    fn common_ancestor(&self, a: usize, b: usize) -> Option<usize> {
        let (mut a, mut b) = (a, b);
        let (mut depth_a, mut depth_b) = (self.depth(a)?, self.depth(b)?);
        while a != b {
            // The deeper one climbs; of two equally deep ones, both do in turn.
            if depth_a >= depth_b {
                a = self.parent(a)?;
                depth_a = depth_a.checked_sub(1)?;
            } else {
                b = self.parent(b)?;
                depth_b = depth_b.checked_sub(1)?;
            }
        }
        Some(a)
    }

    /// `ancestor_from_frame` at a time.
    fn climb(&self, id: usize, ancestor: usize, stamp_ns: i64) -> Result<Isometry3<f64>, TfMiss> {
        let mut sum = Isometry3::identity();
        let mut miss: Option<TfMiss> = None;
        let mut at = id;
        while at != ancestor {
            let Some((parent, link)) = self.frames.get(at).and_then(|f| f.link.as_ref()) else {
                break;
            };
            match link {
                Link::Static(transform) => sum = transform * sum,
                Link::Moving(track) => match track.at(stamp_ns, self.max_gap_ns) {
                    Ok(transform) => sum = transform * sum,
                    Err(cause) => {
                        if miss.as_ref().is_none_or(TfMiss::may_still_come) {
                            miss = Some(tf_miss(self.name(at), cause));
                        }
                    }
                },
            }
            at = *parent;
        }
        miss.map_or(Ok(sum), Err)
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
