//! Incomplete keyframes and updates.

use std::collections::BTreeSet;

use lattice_core::lattice::MortonKey;
use rustc_hash::FxHashMap;

use super::followed_map::Changes;
use crate::convert::map::{History, VoxelColor, VoxelState};

/// Limit of updates stored while a keyframe is received.
pub(super) const MAX_WAITING_UPDATES: usize = 4096;

/// Received chunks of one message. Memory grows with received chunks, not with the stated number.
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

    /// Records a chunk; false if it is a duplicate.
    pub fn insert(&mut self, chunk: u32) -> bool {
        self.received.insert(chunk)
    }

    pub fn complete(&self) -> bool {
        self.received.len() as u64 >= u64::from(self.expected)
    }
}

/// An incomplete update, or one that waits for its predecessor.
pub(super) struct OpenUpdate {
    pub previous: u64,
    pub chunks: Chunks,
    /// Sum over the received chunks.
    pub sum: u64,
    /// Checksum of the map after it.
    pub history: History,
    pub voxels_total: u64,
}

/// An incomplete keyframe, with the updates received meanwhile.
pub(super) struct Staging {
    pub sequence: u64,
    pub history: History,
    pub chunks: Chunks,
    pub voxels: FxHashMap<MortonKey, VoxelState>,
    pub colors: FxHashMap<MortonKey, VoxelColor>,
    /// Newest sequence of the map at the last received chunk.
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
            colors: FxHashMap::default(),
            heard_at: sequence,
            later: Vec::new(),
            later_voxels: 0,
        }
    }

    /// Starts another keyframe and keeps the stored updates.
    pub fn restart(self, sequence: u64, history: History, chunks: u32) -> Self {
        Self {
            later: self.later,
            later_voxels: self.later_voxels,
            ..Self::new(sequence, history, chunks)
        }
    }

    /// Stores an update for the end of the keyframe; false above the limit.
    pub fn keep(&mut self, changes: Changes, max_voxels: usize) -> bool {
        self.later_voxels = self.later_voxels.saturating_add(changes.len());
        let fits = self.later_voxels <= max_voxels && self.later.len() < MAX_WAITING_UPDATES;
        if fits {
            self.later.push(changes);
        }
        fits
    }
}
