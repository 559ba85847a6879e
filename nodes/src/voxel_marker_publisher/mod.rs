//! Markers of the map for viewers: exposed cell faces in blocks, only what changed.
//!
//! [`VoxelMarkers`] is a state machine without I/O; [`node`] runs it behind DDS.

mod blocks;
mod color;
pub mod node;
mod options;
mod parameters;
mod shape;

pub use options::{ColorBy, MarkerOptions, MarkerStyle};
pub use parameters::declare;

use std::collections::{BTreeMap, BTreeSet};

use lattice_msgs::cdr;
use lattice_msgs::geometry_msgs::Pose;
use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};
use lattice_msgs::std_msgs::Header;
use lattice_msgs::visualization_msgs::{Marker, MarkerArray};
use serde::{Deserialize, Serialize};

use self::blocks::{BlockId, Blocks};
use crate::map_follower::{FollowError, Followed, MapFollower};

/// Namespace of all markers.
const NAMESPACE: &str = "voxels";
/// Serialised bytes of a marker beside its points and colours, and of an array beside its markers.
const OVERHEAD_BYTES: usize = 256;

/// Counters of messages taken and markers given.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MarkerCounts {
    /// Chunks of `map` and `map_updates` received.
    pub messages_in: u64,
    /// Chunks refused as malformed or too large.
    pub messages_refused: u64,
    /// Times that a keyframe was found to be needed.
    pub gaps: u64,
    /// Arrays given out.
    pub arrays_out: u64,
    /// Markers added or replaced.
    pub markers_added: u64,
    /// Markers deleted.
    pub markers_deleted: u64,
}

/// The end of a `voxel_marker_publisher`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MarkerReport {
    /// Everything counted by the state machine.
    pub counts: MarkerCounts,
    /// Voxels of the map that it followed.
    pub voxels: usize,
    /// Bytes of all current markers: what a viewer that joins now receives. The node counts them as it draws, rounded
    /// up.
    pub marker_bytes: usize,
    /// Bytes given out over the whole run.
    pub published_bytes: u64,
    /// Arrays that the publisher did not take or could not send.
    pub arrays_not_published: u64,
    /// Changed blocks that were not sent by the end.
    #[serde(default)]
    pub blocks_not_drawn: usize,
    /// Chunks of the map that found the inbox, or the queue before it, full.
    #[serde(default)]
    pub inbox_full: u64,
    /// Chunks of the map that were sent and did not come.
    #[serde(default)]
    pub lost_on_network: u64,
    /// Samples that did not decode.
    #[serde(default)]
    pub undecodable: u64,
}

/// Follows a map and keeps the markers of its blocks up to date.
pub struct VoxelMarkers {
    options: MarkerOptions,
    follower: MapFollower,
    blocks: Blocks,
    dirty: BTreeSet<BlockId>,
    /// Bytes of the markers of each block as they were drawn last.
    drawn: BTreeMap<BlockId, usize>,
    wipe: bool,
    style: MarkerStyle,
    counts: MarkerCounts,
}

impl VoxelMarkers {
    /// Times that the map was found to be another than its mapper's.
    pub fn map_differences(&self) -> u64 {
        self.follower.differences()
    }

    /// Markers of no map yet.
    pub fn new(options: MarkerOptions) -> Self {
        Self {
            follower: MapFollower::new(options.max_voxels),
            blocks: Blocks::new(options.block_bits),
            dirty: BTreeSet::new(),
            drawn: BTreeMap::new(),
            wipe: true,
            style: options.style,
            counts: MarkerCounts::default(),
            options,
        }
    }

    /// Bytes as CDR of all arrays that are due, which then no longer are.
    pub fn take_bytes(&mut self) -> usize {
        let mut bytes = 0;
        while self.is_dirty() {
            for array in self.take_arrays(1 << 20) {
                bytes += cdr::to_vec(&array).map_or(0, |cdr| cdr.len());
            }
        }
        bytes
    }

    /// Bytes of all markers as they were drawn last, rounded up.
    pub fn drawn_bytes(&self) -> usize {
        self.drawn.values().sum()
    }

    /// Goes on with other options: everything is drawn again.
    pub fn set_options(&mut self, options: MarkerOptions) {
        self.follower.set_max_voxels(options.max_voxels);
        if options.block_bits != self.options.block_bits {
            self.blocks = Blocks::new(options.block_bits);
            self.drawn.clear();
            if let Some(map) = self.follower.map() {
                let neighbors = map.lattice.face_neighbors();
                for key in map.voxels().keys() {
                    self.blocks.set(*key, true, neighbors, &mut self.dirty);
                }
            }
        }
        self.options = options;
        self.style = self.wanted_style();
        // Markers of other blocks or of another type go.
        self.wipe();
    }

    /// Takes a chunk of a keyframe.
    pub fn on_map(&mut self, message: &LatticeMap) -> Result<Followed, FollowError> {
        let result = self.follower.on_map(message);
        self.after(result)
    }

    /// Takes a chunk of an update.
    pub fn on_update(&mut self, message: &LatticeMapUpdate) -> Result<Followed, FollowError> {
        let result = self.follower.on_update(message);
        self.after(result)
    }

    /// Draws everything again, for a viewer that has just come; what the others show stays.
    pub fn redraw(&mut self) {
        self.dirty = self.blocks.ids().collect();
    }

    /// Takes away all that viewers show and draws everything again.
    pub fn wipe(&mut self) {
        self.wipe = true;
        self.redraw();
    }

    /// True if a keyframe is to be asked for, since nothing more comes of an incomplete one. To be
    /// called once a second.
    pub fn check_keyframe_timeout(&mut self) -> bool {
        self.follower.check_keyframe_timeout()
    }

    /// Blocks that changed since they were drawn.
    pub fn blocks_due(&self) -> usize {
        self.dirty.len()
    }

    /// True if there is something to publish.
    pub fn is_dirty(&self) -> bool {
        self.follower.map().is_some() && (self.wipe || !self.dirty.is_empty())
    }

    /// Arrays of the blocks that changed, of at most `budget_bytes` together (but at least one
    /// block); the rest stays for the next call.
    pub fn take_arrays(&mut self, budget_bytes: usize) -> Vec<MarkerArray> {
        let mut arrays = Vec::new();
        let Some(map) = self.follower.map() else {
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
        while blocks == 0 || packer.total_bytes < budget_bytes {
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

    /// Voxels of the map at hand.
    pub fn voxels(&self) -> usize {
        self.follower.map().map_or(0, |map| map.voxels().len())
    }

    /// The style drawn now: the cheap one when the map is larger than `max_marker_voxels`.
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
        let Some(map) = self.follower.map() else {
            return result;
        };
        if replaced {
            self.blocks = Blocks::new(self.options.block_bits);
            self.drawn.clear();
            self.dirty.clear();
            self.wipe = true;
        }
        let neighbors = map.lattice.face_neighbors();
        for key in touched {
            let occupied = map.voxels().contains_key(&key);
            self.blocks.set(key, occupied, neighbors, &mut self.dirty);
        }
        let wanted = self.wanted_style();
        if wanted != self.style {
            self.style = wanted;
            self.redraw();
        }
        result
    }
}

/// A marker without points that deletes.
fn bare(header: &Header, id: i32, action: i32) -> Marker {
    let mut pose = Pose::default();
    pose.orientation.w = 1.0;
    Marker {
        header: header.clone(),
        ns: NAMESPACE.to_owned(),
        id,
        action,
        pose,
        ..Marker::default()
    }
}

/// Bytes of a marker on the wire, rounded up.
fn marker_bytes(marker: &Marker) -> usize {
    OVERHEAD_BYTES
        + marker.header.frame_id.len()
        + marker.points.len() * 24
        + marker.colors.len() * 16
}

/// Fills arrays up to a size.
struct Packer {
    chunk_bytes: usize,
    open: MarkerArray,
    open_bytes: usize,
    total_bytes: usize,
}

impl Packer {
    fn new(chunk_bytes: usize) -> Self {
        Self {
            chunk_bytes,
            open: MarkerArray::default(),
            open_bytes: 0,
            total_bytes: 0,
        }
    }

    fn push(&mut self, marker: Marker, arrays: &mut Vec<MarkerArray>) {
        let bytes = marker_bytes(&marker);
        if self.open_bytes + bytes > self.chunk_bytes {
            self.finish(arrays);
        }
        self.open_bytes += bytes;
        self.total_bytes += bytes;
        self.open.markers.push(marker);
    }

    fn finish(&mut self, arrays: &mut Vec<MarkerArray>) {
        if !self.open.markers.is_empty() {
            arrays.push(std::mem::take(&mut self.open));
        }
        self.open_bytes = 0;
    }
}
