//! State machine of the markers, without I/O.

use std::collections::{BTreeMap, BTreeSet};

use lattice_core::lattice::MortonKey;
use lattice_msgs::cdr;
use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};
use lattice_msgs::std_msgs::Header;
use lattice_msgs::visualization_msgs::{Marker, MarkerArray};
use serde::{Deserialize, Serialize};

use super::blocks::{BlockId, Blocks};
use super::options::{MarkerOptions, MarkerStyle};
use super::packer::{NAMESPACE, Packer, bare, marker_bytes};
use super::shape;
use crate::hurry::{CELLS_SORTED, Hurry};
use crate::map_follower::{FollowError, Followed, MapFollower};

/// Number of changed voxels that are placed at once: some 50 ms.
const PLACED_AT_ONCE: usize = 1 << 17;

/// Counters of messages received and markers published.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MarkerCounts {
    /// Chunks of `voxel_map` and `voxel_map_updates` received.
    pub messages_in: u64,
    /// Chunks rejected as malformed or too large.
    pub messages_refused: u64,
    /// Keyframes needed.
    pub gaps: u64,
    /// Arrays published.
    pub arrays_out: u64,
    /// Markers added or replaced.
    pub markers_added: u64,
    /// Markers deleted.
    pub markers_deleted: u64,
}

/// Report of a `voxel_marker_publisher`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MarkerReport {
    /// Counters of the state machine.
    pub counts: MarkerCounts,
    /// Voxels of the followed map.
    pub voxels: usize,
    /// Bytes of all current markers, as sent to a late joiner. The node counts them while drawing, rounded
    /// up.
    pub marker_bytes: usize,
    /// Bytes published over the whole run.
    pub published_bytes: u64,
    /// Arrays dropped by the publisher.
    pub arrays_not_published: u64,
    /// Changed blocks not published by the end.
    #[serde(default)]
    pub blocks_not_drawn: usize,
    /// Changed voxels left out to end in time.
    #[serde(default)]
    pub voxels_not_drawn: usize,
    /// Map chunks rejected by a full inbox or overrun before it.
    #[serde(default)]
    pub inbox_full: u64,
    /// Map chunks lost on the network.
    #[serde(default)]
    pub lost_on_network: u64,
    /// Undecodable samples.
    #[serde(default)]
    pub undecodable: u64,
}

/// Follows a map and updates the markers of its blocks.
pub struct VoxelMarkers {
    options: MarkerOptions,
    follower: MapFollower,
    blocks: Blocks,
    /// True while nothing is drawn.
    resting: bool,
    /// Changed voxels that are not in the blocks yet.
    unplaced: Vec<MortonKey>,
    dirty: BTreeSet<BlockId>,
    /// Marker bytes of each block as last drawn.
    drawn: BTreeMap<BlockId, usize>,
    wipe: bool,
    style: MarkerStyle,
    counts: MarkerCounts,
    hurry: Hurry,
}

impl VoxelMarkers {
    /// Number of detected differences from the mapper's map.
    pub fn map_differences(&self) -> u64 {
        self.follower.differences()
    }

    /// Initial state without a map.
    pub fn new(options: MarkerOptions) -> Self {
        Self {
            follower: MapFollower::new(options.max_voxels),
            blocks: Blocks::new(options.block_bits),
            resting: false,
            unplaced: Vec::new(),
            dirty: BTreeSet::new(),
            drawn: BTreeMap::new(),
            wipe: true,
            style: options.style,
            counts: MarkerCounts::default(),
            options,
            hurry: Hurry::default(),
        }
    }

    /// Leaves out keyframes, and changes that are not placed, after `hurry`.
    pub fn hurried_by(mut self, hurry: &Hurry) -> Self {
        self.follower = self.follower.hurried_by(hurry);
        self.hurry = hurry.clone();
        self
    }

    /// CDR bytes of all pending arrays, which are discarded.
    pub fn take_bytes(&mut self) -> usize {
        let mut bytes = 0;
        while self.is_dirty() {
            for array in self.take_arrays(1 << 20) {
                bytes += cdr::to_vec(&array).map_or(0, |cdr| cdr.len());
            }
        }
        bytes
    }

    /// Bytes of all markers as last drawn, rounded up.
    pub fn drawn_bytes(&self) -> usize {
        self.drawn.values().sum()
    }

    /// Changes the options and redraws everything.
    pub fn set_options(&mut self, options: MarkerOptions) {
        self.follower.set_max_voxels(options.max_voxels);
        if options.block_bits != self.options.block_bits {
            self.blocks = Blocks::new(options.block_bits);
            self.drawn.clear();
            let map = self.follower.map();
            self.unplaced = map.map_or_else(Vec::new, |map| map.voxels().keys().copied().collect());
        }
        self.options = options;
        self.style = self.wanted_style();
        // Markers of other blocks or of another type are deleted.
        self.wipe();
    }

    /// Handles a keyframe chunk.
    pub fn on_map(&mut self, message: &LatticeMap) -> Result<Followed, FollowError> {
        let result = self.follower.on_map(message);
        self.after(result)
    }

    /// Handles an update chunk.
    pub fn on_update(&mut self, message: &LatticeMapUpdate) -> Result<Followed, FollowError> {
        let result = self.follower.on_update(message);
        self.after(result)
    }

    /// Redraws everything for a late joiner; existing markers stay.
    pub fn redraw(&mut self) {
        self.dirty = self.blocks.ids().collect();
    }

    /// Deletes all markers and redraws everything.
    pub fn wipe(&mut self) {
        self.wipe = true;
        self.redraw();
    }

    /// True if a keyframe is to be requested because an incomplete one has timed out. To be
    /// called once a second.
    pub fn check_keyframe_timeout(&mut self) -> bool {
        self.follower.check_keyframe_timeout()
    }

    /// Number of changed blocks.
    pub fn blocks_due(&self) -> usize {
        self.dirty.len()
    }

    /// Draws nothing until [`VoxelMarkers::wake`].
    pub fn rest(&mut self) {
        self.resting = true;
        self.forget();
    }

    /// Draws the whole map after [`VoxelMarkers::rest`].
    pub fn wake(&mut self) {
        if std::mem::take(&mut self.resting) {
            let map = self.follower.map().into_iter();
            self.unplaced = map.flat_map(|map| map.voxels().keys()).copied().collect();
        }
    }

    /// True between [`VoxelMarkers::rest`] and [`VoxelMarkers::wake`].
    pub fn is_resting(&self) -> bool {
        self.resting
    }

    /// Forgets what was drawn.
    fn forget(&mut self) {
        self.blocks = Blocks::new(self.options.block_bits);
        self.unplaced = Vec::new();
        self.drawn.clear();
        self.dirty.clear();
        self.wipe = true;
    }

    /// True if there are changes to publish.
    pub fn is_dirty(&self) -> bool {
        if self.resting {
            return false;
        }
        let has_changes = !self.dirty.is_empty() || !self.unplaced.is_empty();
        self.follower.map().is_some() && (self.wipe || has_changes)
    }

    /// Changed voxels that are not in the blocks yet.
    pub fn unplaced(&self) -> usize {
        self.unplaced.len()
    }

    /// Places changed voxels in the blocks, until the node has to end.
    fn place(&mut self) {
        let Some(map) = self.follower.map() else {
            return;
        };
        let neighbors = map.lattice.face_neighbors();
        while !self.unplaced.is_empty() && !self.hurry.is_requested() {
            let left = self.unplaced.len().saturating_sub(CELLS_SORTED);
            let mut keys = self.unplaced.split_off(left);
            // In order, so that neighbours are near in memory.
            keys.sort_unstable();
            keys.dedup();
            for key in keys {
                let occupied = map.voxels().contains_key(&key);
                self.blocks.set(key, occupied, neighbors, &mut self.dirty);
            }
        }
        self.unplaced.shrink_to(CELLS_SORTED);
    }

    /// Arrays of changed blocks, up to `budget_bytes` (but at least one block) or until the node has to end; the rest stays
    /// pending. None before all changes are in their blocks.
    pub fn take_arrays(&mut self, budget_bytes: usize) -> Vec<MarkerArray> {
        let mut arrays = Vec::new();
        self.place();
        let Some(map) = self.follower.map().filter(|_| self.unplaced.is_empty()) else {
            return arrays;
        };
        let header = Header {
            frame_id: map.frame_id.clone(),
            ..Header::default()
        };
        let mut packer = Packer::new(self.options.chunk_bytes);
        if self.wipe {
            self.wipe = false;
            packer.push(bare(&header, 0, Marker::DELETEALL), &mut arrays);
        }
        let mut blocks = 0;
        while (blocks == 0 || packer.total_bytes < budget_bytes) && !self.hurry.is_requested() {
            let Some(block) = self.dirty.pop_first() else {
                break;
            };
            blocks += 1;
            let shapes = shape::of_block(map, &self.blocks, block, self.style, &self.options);
            let ids = self.blocks.assign_ids(block, shapes.len());
            for id in ids.stale {
                self.counts.markers_deleted += 1;
                packer.push(bare(&header, id, Marker::DELETE), &mut arrays);
            }
            let mut drawn = 0;
            for (id, mut marker) in ids.current.into_iter().zip(shapes) {
                self.counts.markers_added += 1;
                marker.id = id;
                marker.ns = NAMESPACE.to_owned();
                marker.header = header.clone();
                drawn += marker_bytes(&marker);
                // RViz keeps the old cubes of a list unless it is deleted first.
                if marker.type_ == Marker::CUBE_LIST {
                    packer.push(bare(&header, id, Marker::DELETE), &mut arrays);
                }
                packer.push(marker, &mut arrays);
            }
            match drawn {
                0 => self.drawn.remove(&block),
                bytes => self.drawn.insert(block, bytes),
            };
        }
        packer.finish(&mut arrays);
        self.counts.arrays_out += arrays.len() as u64;
        arrays
    }

    /// Counters of messages and markers.
    pub fn counts(&self) -> &MarkerCounts {
        &self.counts
    }

    /// Voxels of the current map.
    pub fn voxels(&self) -> usize {
        self.follower.map().map_or(0, |map| map.voxels().len())
    }

    /// Current style: points if the map exceeds `max_marker_voxels`.
    pub fn style(&self) -> MarkerStyle {
        self.style
    }

    fn wanted_style(&self) -> MarkerStyle {
        match self.voxels() > self.options.max_marker_voxels {
            true => MarkerStyle::Points,
            false => self.options.style,
        }
    }

    fn after(&mut self, result: Result<Followed, FollowError>) -> Result<Followed, FollowError> {
        self.counts.messages_in += 1;
        match &result {
            Err(_) => self.counts.messages_refused += 1,
            Ok(Followed::NeedKeyframe) => self.counts.gaps += 1,
            Ok(_) => {}
        }
        let (touched, replaced) = self.follower.take_touched();
        if self.follower.map().is_none() {
            return result;
        }
        if replaced {
            self.forget();
        }
        if self.resting {
            return result;
        }
        self.unplaced.extend(touched);
        // A keyframe waits until it is drawn, and its changes until then.
        if self.unplaced.len() <= PLACED_AT_ONCE || self.unplaced.len() > 2 * self.voxels() {
            self.place();
        }
        let wanted = self.wanted_style();
        if wanted != self.style {
            self.style = wanted;
            self.redraw();
        }
        result
    }
}
