//! Table of frames with the parents that publishers assign.

use nalgebra::Isometry3;
use rustc_hash::FxHashMap;

use super::TfInsertError;
use super::path::Path;
use crate::pose::track::Track;

/// Maximum number of parents of a frame, static and dynamic ones separately.
const MAX_PARENTS: usize = 4;
const MAX_KEPT: usize = 64;

#[derive(Clone, Debug)]
pub(super) enum Link {
    Static(Isometry3<f64>),
    Moving(Track),
}

/// Parent assigned by a publisher.
#[derive(Clone, Debug)]
struct Claim {
    parent: usize,
    link: Link,
    heard: u64,
}

#[derive(Clone, Debug)]
struct Frame {
    name: String,
    /// Static parents first, then in the order of arrival.
    claims: Vec<Claim>,
    heard: u64,
}

/// Frames by number and by name; `heard` counts transforms, the newest has the highest value.
#[derive(Clone, Debug)]
pub(super) struct Frames {
    frames: Vec<Frame>,
    index: FxHashMap<String, usize>,
    kept: Vec<String>,
    max_frames: usize,
    heard: u64,
}

impl Frames {
    pub fn new(max_frames: usize) -> Self {
        Self {
            frames: Vec::new(),
            index: FxHashMap::default(),
            kept: Vec::new(),
            max_frames,
            heard: 0,
        }
    }

    pub fn len(&self) -> usize {
        self.frames.len()
    }

    pub fn find(&self, name: &str) -> Option<usize> {
        self.index.get(name).copied()
    }

    pub fn name(&self, id: usize) -> &str {
        self.frames.get(id).map_or("", |frame| &frame.name)
    }

    pub fn keep(&mut self, name: &str) {
        let known = self.kept.iter().any(|kept| kept == name);
        if !known && self.kept.len() < MAX_KEPT {
            self.kept.push(name.to_owned());
        }
    }

    /// Parents of a frame, static ones first.
    pub fn parents(&self, id: usize) -> impl Iterator<Item = usize> + '_ {
        let frame = self.frames.get(id);
        frame
            .into_iter()
            .flat_map(|frame| frame.claims.iter().map(|claim| claim.parent))
    }

    /// Transform of a frame to one of its parents; the static one if there are two.
    pub fn claim(&self, id: usize, parent: usize) -> Option<&Link> {
        let mut claims = self.frames.get(id)?.claims.iter();
        let claim = claims.find(|claim| claim.parent == parent);
        claim.map(|claim| &claim.link)
    }

    /// Highest ancestor over static transforms only; the frame itself if there is none.
    pub fn static_root(&self, id: usize) -> usize {
        let parent = |id: usize| {
            let frame = self.frames.get(id)?;
            let mut claims = frame.claims.iter();
            let claim = claims.find(|claim| matches!(claim.link, Link::Static(_)))?;
            Some(claim.parent)
        };
        // The bound ends a loop of static transforms.
        (0..self.frames.len())
            .try_fold(id, |id, _| parent(id).ok_or(id))
            .unwrap_or_else(|root| root)
    }

    /// Shortest path between two frames over a common ancestor.
    pub fn path(&self, target: usize, source: usize) -> Option<Path> {
        Path::find(target, source, |id| self.parents(id))
    }

    /// Dynamic transforms of a child in one of its parents.
    pub fn track_mut(&mut self, parent: &str, child: &str) -> Option<&mut Track> {
        let (parent, child) = (self.find(parent)?, self.find(child)?);
        let claims = self.frames.get_mut(child)?.claims.iter_mut();
        let of_parent = claims.filter(|claim| claim.parent == parent);
        let mut tracks = of_parent.filter_map(|claim| match &mut claim.link {
            Link::Static(_) => None,
            Link::Moving(track) => Some(track),
        });
        tracks.next()
    }

    /// Link from a child to a parent, created if missing; it replaces an opposite one.
    pub fn link(
        &mut self,
        parent: &str,
        child: &str,
        is_static: bool,
    ) -> Result<&mut Link, TfInsertError> {
        let itself = || TfInsertError::Itself(child.to_owned());
        if parent == child {
            return Err(itself());
        }
        self.make_room(parent, child)?;
        self.heard += 1;
        let parent = self.id(parent);
        let child_id = self.id(child);
        if let Some(frame) = self.frames.get_mut(parent) {
            frame.claims.retain(|claim| claim.parent != child_id);
        }
        let is_it = |claim: &Claim| {
            claim.parent == parent && matches!(claim.link, Link::Static(_)) == is_static
        };
        let heard = self.heard;
        let claims = self
            .frames
            .get(child_id)
            .map_or(&[][..], |frame| &frame.claims[..]);
        let at = match claims.iter().position(is_it) {
            Some(at) => at,
            None => self.add_claim(child_id, parent, is_static),
        };
        let frame = self.frames.get_mut(child_id);
        let claim = frame.and_then(|frame| frame.claims.get_mut(at));
        let claim = claim.ok_or_else(itself)?;
        claim.heard = heard;
        Ok(&mut claim.link)
    }

    /// Adds a parent and returns its index; beyond the limit, the one least recently updated is dropped.
    fn add_claim(&mut self, child: usize, parent: usize, is_static: bool) -> usize {
        let protected = self.protected();
        let Some(frame) = self.frames.get_mut(child) else {
            return 0;
        };
        if frame.claims.len() >= MAX_PARENTS {
            let in_use = |claim: &Claim| protected.contains(&(child, claim.parent));
            let claims = frame.claims.iter().enumerate();
            let idle = claims.filter(|(_, claim)| !in_use(claim));
            if let Some((at, _)) = idle.min_by_key(|(_, claim)| claim.heard) {
                frame.claims.remove(at);
            }
        }
        let (at, link) = match is_static {
            true => (0, Link::Static(Isometry3::identity())),
            false => (frame.claims.len(), Link::Moving(Track::default())),
        };
        let heard = self.heard;
        let claim = Claim {
            parent,
            link,
            heard,
        };
        frame.claims.insert(at, claim);
        at
    }

    /// Links from frame to parent between the first kept frame and the others.
    fn protected(&self) -> Vec<(usize, usize)> {
        let mut kept = self.kept.iter().filter_map(|name| self.find(name));
        let Some(first) = kept.next() else {
            return Vec::new();
        };
        let paths = kept.filter_map(|frame| self.path(first, frame));
        paths
            .flat_map(|path| path.to_target().chain(path.to_source()).collect::<Vec<_>>())
            .collect()
    }

    /// Drops frames until two names fit.
    fn make_room(&mut self, parent: &str, child: &str) -> Result<(), TfInsertError> {
        let max_frames = self.max_frames;
        let full = || TfInsertError::TooManyFrames {
            parent: parent.to_owned(),
            child: child.to_owned(),
            max_frames,
        };
        let names = [parent, child];
        let new = names.iter().filter(|name| self.find(name).is_none());
        let most = max_frames.checked_sub(new.count()).ok_or_else(full)?;
        while self.frames.len() > most {
            let links = self.protected();
            let on_path = |id| links.iter().any(|(a, b)| *a == id || *b == id);
            let named = |name: &str| name == parent || name == child;
            let idle = |(id, frame): &(usize, &Frame)| {
                !(named(&frame.name) || self.kept.contains(&frame.name) || on_path(*id))
            };
            let frames = self.frames.iter().enumerate().filter(idle);
            let oldest = frames.min_by_key(|(_, frame)| frame.heard);
            let (id, _) = oldest.ok_or_else(full)?;
            self.remove(id);
        }
        Ok(())
    }

    fn remove(&mut self, id: usize) {
        let frame = self.frames.swap_remove(id);
        self.index.remove(&frame.name);
        let moved = self.frames.len();
        for frame in &mut self.frames {
            frame.claims.retain(|claim| claim.parent != id);
            for claim in &mut frame.claims {
                if claim.parent == moved {
                    claim.parent = id;
                }
            }
        }
        if let Some(frame) = self.frames.get(id) {
            self.index.insert(frame.name.clone(), id);
        }
    }

    /// Index of a named frame, created if missing.
    fn id(&mut self, name: &str) -> usize {
        let id = self.find(name).unwrap_or(self.frames.len());
        let heard = self.heard;
        match self.frames.get_mut(id) {
            Some(frame) => frame.heard = heard,
            None => {
                self.index.insert(name.to_owned(), id);
                self.frames.push(Frame {
                    name: name.to_owned(),
                    claims: Vec::new(),
                    heard,
                });
            }
        }
        id
    }

    pub fn validate(&self, max_samples: usize) -> Result<(), String> {
        let (frames, names, max) = (self.frames.len(), self.index.len(), self.max_frames);
        if frames > max || frames != names {
            return Err(format!("{frames} frames, {names} names, limit {max}"));
        }
        for (id, frame) in self.frames.iter().enumerate() {
            let name = &frame.name;
            if self.find(name) != Some(id) {
                return Err(format!("frame '{name}' is not found by name"));
            }
            if frame.claims.len() > MAX_PARENTS {
                let parents = frame.claims.len();
                return Err(format!(
                    "frame '{name}' has {parents} parents, over {MAX_PARENTS}"
                ));
            }
            for claim in &frame.claims {
                if claim.parent >= frames || claim.parent == id {
                    let parent = claim.parent;
                    return Err(format!(
                        "frame '{name}' of index {id} has parent {parent}, not another index below {frames}"
                    ));
                }
                if let Link::Moving(track) = &claim.link {
                    let valid = track.validate(max_samples);
                    valid.map_err(|e| format!("frame '{name}': {e}"))?;
                }
            }
        }
        Ok(())
    }
}
