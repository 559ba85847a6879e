//! Keyframes and updates of which chunks are still to come.

use std::collections::BTreeSet;

use lattice_core::lattice::MortonKey;
use rustc_hash::FxHashMap;

use super::followed_map::Changes;
use crate::convert::map::{History, VoxelState};

/// Most updates remembered while a keyframe comes in.
pub(super) const MAX_WAITING_UPDATES: usize = 4096;

/// Chunks of one message that have come. Memory grows with what came, not with what was promised.
pub(super) struct Chunks {
    pub expected: u32,
    received: BTreeSet<u32>,
}

impl Chunks {
    pub fn new(expected: u32) -> Self {
        Self {
            expected,
            received: BTreeSet::new(),
        }
    }

    /// Notes a chunk; false if it had come before.
    pub fn insert(&mut self, chunk: u32) -> bool {
        self.received.insert(chunk)
    }

    pub fn complete(&self) -> bool {
        self.received.len() as u64 >= u64::from(self.expected)
    }
}

/// An update of which not all chunks have come, or that waits for the one before it.
pub(super) struct OpenUpdate {
    pub previous: u64,
    pub chunks: Chunks,
    /// Over the chunks that have come.
    pub sum: u64,
    /// State of the map after it.
    pub history: History,
    pub voxels_total: u64,
}

/// A keyframe of which not all chunks have come, with the updates that came meanwhile.
pub(super) struct Staging {
    pub sequence: u64,
    pub history: History,
    pub chunks: Chunks,
    pub voxels: FxHashMap<MortonKey, VoxelState>,
    /// Newest sequence of the map when the last chunk came.
    pub heard_at: u64,
    pub later: Vec<Changes>,
    later_voxels: usize,
}

impl Staging {
    pub fn new(sequence: u64, history: History, chunks: u32) -> Self {
        Self {
            sequence,
            history,
            chunks: Chunks::new(chunks),
            voxels: FxHashMap::default(),
            heard_at: sequence,
            later: Vec::new(),
            later_voxels: 0,
        }
    }

    /// Begins a further keyframe, which the updates at hand are also for.
    pub fn restart(self, sequence: u64, history: History, chunks: u32) -> Self {
        Self {
            later: self.later,
            later_voxels: self.later_voxels,
            ..Self::new(sequence, history, chunks)
        }
    }

    /// Keeps an update for the end of the keyframe; false if that would be too much.
    pub fn keep(&mut self, changes: Changes, max_voxels: usize) -> bool {
        self.later_voxels = self.later_voxels.saturating_add(changes.len());
        let fits = self.later_voxels <= max_voxels && self.later.len() < MAX_WAITING_UPDATES;
        if fits {
            self.later.push(changes);
        }
        fits
    }
}
