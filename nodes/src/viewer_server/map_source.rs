//! Map of the viewer: follows the mapper's map, and creates keyframes and merged updates for clients.
//!
//! Sequences and epochs are the mapper's. Checksums are computed for the updates sent to clients.

use lattice_core::lattice::MortonKey;
use lattice_core::voxels::codec;
use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::cdr;
use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};
use lattice_msgs::std_msgs::Header;
use serde_bytes::ByteBuf;

use super::broadcast::{Entry, thin};
use crate::convert::map::{History, keys_with_colors, plain_keys, sign};
use crate::hurry::Hurry;
use crate::map_follower::{FollowError, Followed, FollowedMap, MapFollower};

/// Voxels per message: some 60 kB with labels.
const CHUNK_VOXELS: usize = 3000;

/// Change of the map since the last call.
#[derive(Debug)]
pub enum MapChange {
    /// None.
    Unchanged,
    /// All of it: it is another map.
    Replaced,
    /// Update chunks.
    Updates(Vec<Entry>),
}

/// Follows the map and encodes it for clients.
pub struct MapSource {
    follower: MapFollower,
    /// State last sent to clients.
    sent: Option<Sent>,
}

#[derive(Clone, Copy)]
struct Sent {
    epoch: u64,
    sequence: u64,
    history: History,
}

impl MapSource {
    /// An empty source that keeps at most `max_voxels`.
    pub fn new(max_voxels: usize) -> Self {
        Self {
            follower: MapFollower::new(max_voxels),
            sent: None,
        }
    }

    /// Leaves keyframes out after `hurry`.
    pub fn hurried_by(mut self, hurry: &Hurry) -> Self {
        self.follower = self.follower.hurried_by(hurry);
        self
    }

    /// Handles a keyframe chunk.
    pub fn on_map(&mut self, chunk: &LatticeMap) -> Result<Followed, FollowError> {
        self.follower.on_map(chunk)
    }

    /// Handles an update chunk.
    pub fn on_update(&mut self, chunk: &LatticeMapUpdate) -> Result<Followed, FollowError> {
        self.follower.on_update(chunk)
    }

    /// To be called once a second; true if a keyframe is to be requested.
    pub fn check_keyframe_timeout(&mut self) -> bool {
        self.follower.check_keyframe_timeout()
    }

    /// The current map.
    pub fn map(&self) -> Option<&FollowedMap> {
        self.follower.map()
    }

    /// Changes since the last call; unchanged while an update is incomplete.
    pub fn take_change(&mut self) -> Result<MapChange, cdr::CdrError> {
        let (Some(map), Some(sequence)) = (self.follower.map(), self.follower.sequence()) else {
            return Ok(MapChange::Unchanged);
        };
        let epoch = map.info.epoch;
        let known = self.sent.filter(|sent| sent.epoch == epoch);
        if known.is_some_and(|sent| sent.sequence == sequence) {
            return Ok(MapChange::Unchanged);
        }
        let (touched, replaced) = self.follower.take_touched();
        let Some(map) = self.follower.map() else {
            return Ok(MapChange::Unchanged);
        };
        let Some(sent) = known.filter(|_| !replaced) else {
            let history = History::default();
            self.sent = Some(Sent {
                epoch,
                sequence,
                history,
            });
            return Ok(MapChange::Replaced);
        };
        let mut keys = touched;
        keys.sort_unstable();
        keys.dedup();
        let mut chunks = update(map, &keys, sent.sequence, sequence);
        let history = sign(&mut chunks, sent.history, sequence, map.voxels().len());
        self.sent = Some(Sent {
            epoch,
            sequence,
            history,
        });
        let updates = chunks
            .into_iter()
            .map(thin::both)
            .collect::<Result<_, _>>()?;
        Ok(MapChange::Updates(updates))
    }

    /// Keyframe of the state sent to clients; `None` if there is none, or the map is ahead of it.
    pub fn keyframe(&self) -> Result<Option<Vec<Entry>>, cdr::CdrError> {
        let (Some(map), Some(sent)) = (self.follower.map(), self.sent) else {
            return Ok(None);
        };
        if (map.info.epoch, self.follower.sequence()) != (sent.epoch, Some(sent.sequence)) {
            return Ok(None);
        }
        let chunks = keyframe(map, sent.sequence, sent.history);
        chunks
            .into_iter()
            .map(thin::both)
            .collect::<Result<_, _>>()
            .map(Some)
    }
}

fn header(map: &FollowedMap) -> Header {
    Header {
        stamp: Time::from_ns(map.stamp_ns),
        frame_id: map.frame_id.clone(),
    }
}

/// Voxel columns of a message.
#[derive(Default)]
struct Columns {
    keys: ByteBuf,
    key_encoding: String,
    counts: Vec<u32>,
    mean_offsets: Vec<i16>,
    labels: Vec<u16>,
    label_counts: Vec<u32>,
}

impl Columns {
    fn of(map: &FollowedMap, keys: &[MortonKey]) -> Self {
        let (encoded, key_encoding) = match map.has_colors() {
            true => keys_with_colors(keys, |key| map.color(key)),
            false => plain_keys(keys),
        };
        let mut columns = Self {
            keys: encoded,
            key_encoding,
            ..Self::default()
        };
        for voxel in keys.iter().filter_map(|key| map.voxels().get(key)) {
            columns.counts.push(voxel.count);
            columns.mean_offsets.extend(voxel.mean_offset);
            columns.labels.push(voxel.label);
            columns.label_counts.push(voxel.label_count);
        }
        if columns.label_counts.iter().all(|count| *count == 0) {
            columns.labels.clear();
            columns.label_counts.clear();
        }
        columns
    }
}

fn keyframe(map: &FollowedMap, sequence: u64, history: History) -> Vec<LatticeMap> {
    let mut keys: Vec<MortonKey> = map.voxels().keys().copied().collect();
    keys.sort_unstable();
    let parts: Vec<&[MortonKey]> = match keys.is_empty() {
        true => vec![&[]],
        false => keys.chunks(CHUNK_VOXELS).collect(),
    };
    let chunk = |(chunk, part): (u32, &&[MortonKey])| {
        let columns = Columns::of(map, part);
        LatticeMap {
            header: header(map),
            info: map.info.clone(),
            sequence,
            chunk,
            chunks: parts.len() as u32,
            voxels_total: keys.len() as u64,
            key_encoding: columns.key_encoding,
            voxels: part.len() as u32,
            keys: columns.keys,
            counts: columns.counts,
            offset_unit_m: map.offset_unit_m,
            mean_offsets: columns.mean_offsets,
            labels: columns.labels,
            label_counts: columns.label_counts,
            history_checksum: history.0,
        }
    };
    (0..).zip(&parts).map(chunk).collect()
}

fn update(
    map: &FollowedMap,
    keys: &[MortonKey],
    previous_sequence: u64,
    sequence: u64,
) -> Vec<LatticeMapUpdate> {
    let parts: Vec<&[MortonKey]> = match keys.is_empty() {
        true => vec![&[]],
        false => keys.chunks(CHUNK_VOXELS).collect(),
    };
    let chunk = |(chunk, part): (u32, &&[MortonKey])| {
        let here = |key: &&MortonKey| map.voxels().contains_key(key);
        let (changed, removed): (Vec<MortonKey>, Vec<MortonKey>) =
            part.iter().partition(|key| here(key));
        let columns = Columns::of(map, &changed);
        LatticeMapUpdate {
            header: header(map),
            info: map.info.clone(),
            previous_sequence,
            sequence,
            chunk,
            chunks: parts.len() as u32,
            key_encoding: columns.key_encoding,
            voxels: changed.len() as u32,
            keys: columns.keys,
            counts: columns.counts,
            offset_unit_m: map.offset_unit_m,
            mean_offsets: columns.mean_offsets,
            labels: columns.labels,
            label_counts: columns.label_counts,
            removed: removed.len() as u32,
            removed_keys: ByteBuf::from(codec::encode_keys(&removed)),
            ..LatticeMapUpdate::default()
        }
    };
    (0..).zip(&parts).map(chunk).collect()
}
