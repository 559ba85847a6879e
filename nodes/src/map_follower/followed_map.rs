//! Lattice and voxels of a followed map.

use std::collections::HashMap;

use lattice_core::lattice::{Lattice, MortonKey};
use lattice_core::registration::{LabelDistribution, SemanticCloud, UNLABELED};
use lattice_msgs::lattice::{LatticeInfo, LatticeMapUpdate};
use nalgebra::Vector3;
use rustc_hash::{FxBuildHasher, FxHashMap};

use super::FollowError;
use crate::convert::map::{self, Decoded, MapMessageError, VoxelColor, VoxelState};
use crate::hurry::{CELLS_BETWEEN_LOOKS, Hurry};

/// Lattice and voxels of a followed map.
pub struct FollowedMap {
    /// Lattice info as received.
    pub info: LatticeInfo,
    /// Lattice of the info.
    pub lattice: Lattice,
    /// Datum of the lattice in the map frame, metres.
    pub datum_m: Vector3<f64>,
    /// Frame of the map.
    pub frame_id: String,
    /// Stamp of the newest message.
    pub stamp_ns: i64,
    /// Unit of mean offsets, in metres.
    pub offset_unit_m: f64,
    voxels: FxHashMap<MortonKey, VoxelState>,
    colors: FxHashMap<MortonKey, VoxelColor>,
}

/// Decoded content of one update chunk.
pub(super) struct Changes {
    pub sequence: u64,
    stamp_ns: i64,
    changed: Decoded,
    removed: Vec<MortonKey>,
    /// Sum for the checksum.
    pub sum: u64,
}

impl Changes {
    pub fn of(message: &LatticeMapUpdate, max_voxels: usize) -> Result<Self, MapMessageError> {
        let changed = map::voxels_from(message.into(), max_voxels)?;
        let removed = map::keys_from(&message.key_encoding, &message.removed_keys, max_voxels)?;
        Ok(Self {
            sequence: message.sequence,
            stamp_ns: message.header.stamp.to_ns(),
            sum: map::changes_sum(&changed, &removed),
            changed,
            removed,
        })
    }

    /// Number of changed and removed voxels.
    pub fn len(&self) -> usize {
        self.changed.voxels.len() + self.removed.len()
    }
}

impl FollowedMap {
    /// Creates an empty map.
    pub(super) fn empty(info: &LatticeInfo, offset_unit_m: f64) -> Result<Self, MapMessageError> {
        let (lattice, datum_m) = map::lattice_from(info)?;
        Ok(Self {
            info: info.clone(),
            lattice,
            datum_m,
            frame_id: String::new(),
            stamp_ns: 0,
            offset_unit_m,
            voxels: FxHashMap::default(),
            colors: FxHashMap::default(),
        })
    }

    /// Voxels in arbitrary order.
    pub fn voxels(&self) -> &HashMap<MortonKey, VoxelState, FxBuildHasher> {
        &self.voxels
    }

    /// Mean colour of a voxel; `None` if it has none.
    pub fn color(&self, key: MortonKey) -> Option<VoxelColor> {
        self.colors.get(&key).copied()
    }

    /// True if any voxel has a colour.
    pub fn has_colors(&self) -> bool {
        !self.colors.is_empty()
    }

    /// Centre of a cell in the map frame, in metres.
    pub fn center_m(&self, key: MortonKey) -> Vector3<f64> {
        self.datum_m + self.lattice.center(key.unpack())
    }

    /// Mean point of each voxel with the fraction of its most frequent label, in the map frame and
    /// in key order; unlabelled if the map has no labels.
    pub fn semantic_cloud(&self) -> SemanticCloud {
        let mut voxels: Vec<(&MortonKey, &VoxelState)> = self.voxels.iter().collect();
        voxels.sort_unstable_by_key(|(key, _)| **key);
        let mut cloud = SemanticCloud::default();
        for (key, voxel) in &voxels {
            let offset = Vector3::from(voxel.mean_offset.map(f64::from)) * self.offset_unit_m;
            cloud.points_m.push((self.center_m(**key) + offset).into());
        }
        if voxels.iter().any(|(_, voxel)| voxel.label_count > 0) {
            cloud.labels.extend(voxels.iter().map(|(_, voxel)| {
                let rest = voxel.count.saturating_sub(voxel.label_count);
                let weights = [(voxel.label, voxel.label_count), (UNLABELED, rest)];
                LabelDistribution::from_weights(weights.map(|(label, n)| (label, n as f32)))
            }));
        }
        cloud
    }

    /// True if messages with `info` belong to this map.
    pub(super) fn is_of(&self, info: &LatticeInfo) -> bool {
        self.info.epoch == info.epoch
            && self.info.lattice == info.lattice
            && self.info.cell_volume_m3 == info.cell_volume_m3
            && self.info.generator == info.generator
            && self.info.map_from_lattice == info.map_from_lattice
    }

    /// Replaces all voxels; added, changed and removed keys are appended to `touched`. False, and no effect, if the node has
    /// to end before that.
    pub(super) fn replace(
        &mut self,
        voxels: FxHashMap<MortonKey, VoxelState>,
        colors: FxHashMap<MortonKey, VoxelColor>,
        touched: &mut Vec<MortonKey>,
        hurry: &Hurry,
    ) -> bool {
        let known = touched.len();
        let gone = self
            .voxels
            .keys()
            .map(|key| (key, !voxels.contains_key(key)));
        let new = voxels.iter();
        let is_new = |key: &MortonKey, state: &VoxelState| {
            self.voxels.get(key) != Some(state) || self.colors.get(key) != colors.get(key)
        };
        let new = new.map(|(key, state)| (key, is_new(key, state)));
        for (at, (key, is_touched)) in gone.chain(new).enumerate() {
            if at.is_multiple_of(CELLS_BETWEEN_LOOKS) && hurry.is_requested() {
                touched.truncate(known);
                return false;
            }
            if is_touched {
                touched.push(*key);
            }
        }
        (self.voxels, self.colors) = (voxels, colors);
        true
    }

    /// Applies an update chunk; repetition has no effect.
    pub(super) fn apply(
        &mut self,
        changes: &Changes,
        limit: usize,
        touched: &mut Vec<MortonKey>,
    ) -> Result<(), FollowError> {
        let Decoded { voxels, colors } = &changes.changed;
        if self.voxels.len() + voxels.len() > limit {
            let new = voxels.iter();
            let new = new.filter(|(key, _)| !self.voxels.contains_key(key));
            let found = self.voxels.len() + new.count();
            if found > limit {
                let found = found as u64;
                return Err(FollowError::TooLarge { found, limit });
            }
        }
        self.stamp_ns = changes.stamp_ns;
        for key in &changes.removed {
            self.colors.remove(key);
            if self.voxels.remove(key).is_some() {
                touched.push(*key);
            }
        }
        let mut colors = colors.iter().peekable();
        for (key, state) in voxels {
            let color = colors.next_if(|(colored, _)| colored == key);
            let color = color.map(|(_, color)| *color);
            let before = match color {
                Some(color) => self.colors.insert(*key, color),
                None => self.colors.remove(key),
            };
            if self.voxels.insert(*key, *state) != Some(*state) || before != color {
                touched.push(*key);
            }
        }
        Ok(())
    }
}
