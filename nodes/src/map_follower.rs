//! The consumer's side of `map` and `map_updates`: keyframes, deltas, gaps and late joining.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use lattice_core::lattice::{Lattice, MortonKey};
use lattice_core::registration::{LabelDistribution, SemanticCloud, UNLABELED};
use lattice_msgs::lattice::{LatticeInfo, LatticeMap, LatticeMapUpdate};
use nalgebra::Vector3;
use rustc_hash::{FxBuildHasher, FxHashMap, FxHashSet};
use thiserror::Error;

use crate::convert::map::{self, MapMessageError, VoxelState};

/// Most chunks that one keyframe or update may have.
const MAX_CHUNKS: u32 = 1 << 16;
/// Updates after which the rest of a keyframe is taken for lost.
const MAX_STAGING_UPDATES: u64 = 10;
/// Most updates remembered while a keyframe comes in.
const MAX_WAITING_UPDATES: usize = 4096;

/// Why a message of the map was not taken. The map is as it was before.
#[derive(Debug, Error)]
pub enum FollowError {
    /// Malformed.
    #[error(transparent)]
    Message(#[from] MapMessageError),
    /// More voxels than allowed.
    #[error("the map has {found} voxels, at most {limit} are kept (`max_voxels`)")]
    TooLarge {
        /// Voxels that there would be.
        found: u64,
        /// The limit.
        limit: usize,
    },
}

/// What a message did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Followed {
    /// Applied, or kept until the rest of its keyframe has come.
    Applied,
    /// Of an older state than the one at hand; ignored.
    Old,
    /// Something before it was lost or never received: ask for a keyframe.
    NeedKeyframe,
}

/// The lattice and voxels of a map that is being followed.
pub struct FollowedMap {
    /// Description as received.
    pub info: LatticeInfo,
    /// The lattice it names.
    pub lattice: Lattice,
    /// Its datum in the map frame, in metres.
    pub datum_m: Vector3<f64>,
    /// Frame of the map.
    pub frame_id: String,
    /// Stamp of the newest message.
    pub stamp_ns: i64,
    /// Unit of mean offsets, in metres.
    pub offset_unit_m: f64,
    voxels: FxHashMap<MortonKey, VoxelState>,
}

impl FollowedMap {
    /// Voxels in no order.
    pub fn voxels(&self) -> &HashMap<MortonKey, VoxelState, FxBuildHasher> {
        &self.voxels
    }

    /// Centre of a cell in the map frame, in metres.
    pub fn center_m(&self, key: MortonKey) -> Vector3<f64> {
        self.datum_m + self.lattice.center(key.unpack())
    }

    /// The mean point of each voxel with the share of its most frequent label, in the map frame and
    /// in the order of the keys; without labels if the map has none.
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
}

/// Chunks of one message that have come. Memory grows with what came, not with what was promised.
struct Chunks {
    expected: u32,
    received: BTreeSet<u32>,
}

impl Chunks {
    fn new(expected: u32) -> Self {
        Self {
            expected,
            received: BTreeSet::new(),
        }
    }

    fn complete(&self) -> bool {
        self.received.len() as u64 >= u64::from(self.expected)
    }
}

/// An update of which not all chunks have come, or that waits for the one before it.
struct OpenUpdate {
    previous: u64,
    chunks: Chunks,
}

/// A keyframe of which not all chunks have come.
struct Staging {
    sequence: u64,
    chunks: Chunks,
    voxels: FxHashMap<MortonKey, VoxelState>,
    later: Vec<LatticeMapUpdate>,
    later_voxels: usize,
}

/// Follows one map from its two topics.
pub struct MapFollower {
    max_voxels: usize,
    map: Option<FollowedMap>,
    sequence: u64,
    staging: Option<Staging>,
    open_updates: BTreeMap<u64, OpenUpdate>,
    touched: FxHashSet<MortonKey>,
    replaced: bool,
}

impl MapFollower {
    /// Follows nothing yet; keeps at most `max_voxels`.
    pub fn new(max_voxels: usize) -> Self {
        Self {
            max_voxels,
            map: None,
            sequence: 0,
            staging: None,
            open_updates: BTreeMap::new(),
            touched: FxHashSet::default(),
            replaced: false,
        }
    }

    /// The map as far as it is complete.
    pub fn map(&self) -> Option<&FollowedMap> {
        self.map.as_ref()
    }

    /// Sequence that the map is at.
    pub fn sequence(&self) -> u64 {
        self.sequence
    }

    /// Keys whose voxels came, changed or went since the call before, and whether the lattice,
    /// epoch or datum is a new one (then nothing of the old map holds).
    pub fn take_touched(&mut self) -> (FxHashSet<MortonKey>, bool) {
        (
            std::mem::take(&mut self.touched),
            std::mem::take(&mut self.replaced),
        )
    }

    /// Takes one chunk of a keyframe.
    pub fn on_map(&mut self, message: &LatticeMap) -> Result<Followed, FollowError> {
        check_chunk(message.chunk, message.chunks)?;
        if message.voxels_total > self.max_voxels as u64 {
            return Err(FollowError::TooLarge {
                found: message.voxels_total,
                limit: self.max_voxels,
            });
        }
        let voxels = map::voxels_from(message.into(), self.max_voxels)?;
        let fresh = self.describe(&message.info, message.offset_unit_m)?;
        if fresh.is_none() && message.sequence < self.sequence {
            return Ok(Followed::Old);
        }
        if let Some(map) = fresh {
            self.begin_epoch(map);
        }
        if let Some(map) = &mut self.map {
            map.frame_id.clone_from(&message.header.frame_id);
            map.stamp_ns = message.header.stamp.to_ns();
        }
        let newer = self
            .staging
            .as_ref()
            .is_none_or(|staging| staging.sequence != message.sequence);
        if newer {
            if self.staging.is_none() {
                // Updates that wait for a lost one are not in `later`: they must come again.
                self.open_updates.clear();
            }
            let (later, later_voxels) = self
                .staging
                .take()
                .map_or((Vec::new(), 0), |old| (old.later, old.later_voxels));
            self.staging = Some(Staging {
                sequence: message.sequence,
                chunks: Chunks::new(message.chunks),
                voxels: FxHashMap::default(),
                later,
                later_voxels,
            });
        }
        self.stage(message.chunk, voxels)
    }

    /// Takes one chunk of an update.
    pub fn on_update(&mut self, message: &LatticeMapUpdate) -> Result<Followed, FollowError> {
        check_chunk(message.chunk, message.chunks)?;
        let Some(current) = &self.map else {
            return Ok(Followed::NeedKeyframe);
        };
        if current.info.epoch != message.info.epoch || current.info.lattice != message.info.lattice
        {
            return Ok(Followed::NeedKeyframe);
        }
        if message.sequence <= self.sequence {
            return Ok(Followed::Old);
        }
        let lost = message.previous_sequence > self.sequence
            && !self.open_updates.contains_key(&message.sequence)
            && self.staging.is_none();
        self.apply(message)?;
        if let Some(staging) = &mut self.staging {
            staging.later_voxels += message.counts.len() + message.removed_keys.len();
            let fits = staging.later_voxels <= self.max_voxels;
            if fits && staging.later.len() < MAX_WAITING_UPDATES {
                staging.later.push(message.clone());
            } else {
                self.staging = None;
                return Ok(Followed::NeedKeyframe);
            }
        }
        let open = self
            .open_updates
            .entry(message.sequence)
            .or_insert_with(|| OpenUpdate {
                previous: message.previous_sequence,
                chunks: Chunks::new(message.chunks),
            });
        open.chunks.received.insert(message.chunk);
        self.advance();
        // A keyframe that the updates have overtaken is of no more use.
        if let Some(staging) = &self.staging {
            if staging.sequence < self.sequence {
                self.staging = None;
            } else if message.sequence.saturating_sub(staging.sequence) > MAX_STAGING_UPDATES {
                return Ok(Followed::NeedKeyframe);
            }
        }
        if self.open_updates.len() > MAX_WAITING_UPDATES {
            self.open_updates.clear();
            return Ok(Followed::NeedKeyframe);
        }
        Ok(if lost {
            Followed::NeedKeyframe
        } else {
            Followed::Applied
        })
    }

    /// Moves the sequence over every update whose chunks are all here and follow on.
    fn advance(&mut self) {
        while let Some(entry) = self.open_updates.first_entry() {
            let open = entry.get();
            let sequence = *entry.key();
            let follows = open.previous <= self.sequence && open.chunks.complete();
            if sequence > self.sequence && !follows {
                break;
            }
            entry.remove();
            self.sequence = self.sequence.max(sequence);
        }
    }

    /// A description of the map when it differs from the one at hand.
    fn describe(
        &self,
        info: &LatticeInfo,
        offset_unit_m: f64,
    ) -> Result<Option<FollowedMap>, FollowError> {
        let same = self.map.as_ref().is_some_and(|map| {
            let known = &map.info;
            known.epoch == info.epoch
                && known.lattice == info.lattice
                && known.cell_volume_m3 == info.cell_volume_m3
                && known.generator == info.generator
                && known.map_from_lattice == info.map_from_lattice
        });
        if same {
            return Ok(None);
        }
        let (lattice, datum_m) = map::lattice_from(info)?;
        Ok(Some(FollowedMap {
            info: info.clone(),
            lattice,
            datum_m,
            frame_id: String::new(),
            stamp_ns: 0,
            offset_unit_m,
            voxels: FxHashMap::default(),
        }))
    }

    fn begin_epoch(&mut self, map: FollowedMap) {
        self.map = Some(map);
        self.sequence = 0;
        self.staging = None;
        self.open_updates.clear();
        self.touched.clear();
        self.replaced = true;
    }

    fn stage(
        &mut self,
        chunk: u32,
        voxels: Vec<(MortonKey, VoxelState)>,
    ) -> Result<Followed, FollowError> {
        let Some(staging) = &mut self.staging else {
            return Ok(Followed::Applied);
        };
        if staging.chunks.received.insert(chunk) {
            staging.voxels.extend(voxels);
        }
        if staging.voxels.len() > self.max_voxels {
            let found = staging.voxels.len() as u64;
            self.staging = None;
            return Err(FollowError::TooLarge {
                found,
                limit: self.max_voxels,
            });
        }
        if !staging.chunks.complete() {
            return Ok(Followed::Applied);
        }
        if let Some(done) = self.staging.take() {
            self.adopt(done)?;
        }
        Ok(Followed::Applied)
    }

    /// Puts a complete keyframe in place of the voxels, then what came after it.
    fn adopt(&mut self, done: Staging) -> Result<(), FollowError> {
        let Some(map) = &mut self.map else {
            return Ok(());
        };
        let old = std::mem::replace(&mut map.voxels, done.voxels);
        let voxels = &map.voxels;
        self.touched
            .extend(old.keys().filter(|key| !voxels.contains_key(key)));
        self.touched.extend(
            voxels
                .iter()
                .filter(|(key, state)| old.get(key) != Some(state))
                .map(|(key, _)| *key),
        );
        self.sequence = self.sequence.max(done.sequence);
        let later = done.later.iter();
        for update in later.filter(|update| update.sequence > done.sequence) {
            self.apply(update)?;
        }
        self.advance();
        Ok(())
    }

    /// Puts the states of an update chunk into the map; doing it twice changes nothing.
    fn apply(&mut self, message: &LatticeMapUpdate) -> Result<(), FollowError> {
        let limit = self.max_voxels;
        let Some(map) = &mut self.map else {
            return Ok(());
        };
        let voxels = map::voxels_from(message.into(), limit)?;
        let removed = map::keys_from(&message.key_encoding, &message.removed_keys, limit)?;
        if map.voxels.len() + voxels.len() > limit {
            let new = voxels
                .iter()
                .filter(|(key, _)| !map.voxels.contains_key(key));
            let found = map.voxels.len() + new.count();
            if found > limit {
                let found = found as u64;
                return Err(FollowError::TooLarge { found, limit });
            }
        }
        map.stamp_ns = message.header.stamp.to_ns();
        for key in removed {
            if map.voxels.remove(&key).is_some() {
                self.touched.insert(key);
            }
        }
        for (key, state) in voxels {
            if map.voxels.insert(key, state) != Some(state) {
                self.touched.insert(key);
            }
        }
        Ok(())
    }
}

fn check_chunk(chunk: u32, chunks: u32) -> Result<(), MapMessageError> {
    if chunk < chunks && chunks <= MAX_CHUNKS {
        Ok(())
    } else {
        Err(MapMessageError::Chunk { chunk, chunks })
    }
}
