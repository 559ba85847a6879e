//! Voxels split into messages of bounded size.

use lattice_core::lattice::{Lattice, MortonKey};
use lattice_core::voxels::{Changes, Voxel, VoxelList, VoxelStore, codec};
use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};
use nalgebra::Vector3;
use serde_bytes::ByteBuf;

use super::colors::{VoxelColor, keys_with_colors, plain_keys};
use super::error::KEY_ENCODING;
use super::lattice_info::{MapStamp, info_of};
use super::voxels::labels_of;

/// Upper bound of a chunk's bytes besides voxels: header, info, lengths.
const CHUNK_OVERHEAD_BYTES: usize = 1024;
/// Count and mean offset of one voxel.
const PAYLOAD_BYTES: usize = 4 + 3 * 2;
/// Label and label count of one voxel.
const LABEL_BYTES: usize = 2 + 4;

/// Colour of one voxel: its count as LEB128 and three bytes.
const COLOR_BYTES: usize = 5 + 3;

/// Keys and payload of a chunk's voxels; columns are empty if not kept.
#[derive(Default)]
struct Payloads {
    keys: ByteBuf,
    key_encoding: String,
    counts: Vec<u32>,
    mean_offsets: Vec<i16>,
    labels: Vec<u16>,
    label_counts: Vec<u32>,
}

impl Payloads {
    fn of(list: &VoxelList, keys: &[MortonKey]) -> Self {
        let voxels = list.get_all(keys);
        let (labels, label_counts) = labels_of(list, keys);
        let color = |key| VoxelColor::of_cell(list, key);
        let (encoded, key_encoding) = match list.payload().color {
            true => keys_with_colors(keys, color),
            false => plain_keys(keys),
        };
        Self {
            keys: encoded,
            key_encoding,
            counts: voxels.iter().map(|voxel| voxel.count).collect(),
            mean_offsets: mean_offsets(voxels.iter(), offset_unit_m(list.lattice())),
            labels,
            label_counts,
        }
    }

    /// Keys alone.
    fn of_cells(keys: &[MortonKey]) -> Self {
        let (keys, key_encoding) = plain_keys(keys);
        Self {
            keys,
            key_encoding,
            ..Self::default()
        }
    }
}

/// Keyframe of a list as self-contained chunks; an empty list is one chunk without voxels. None if the node has to end
/// before they are made.
pub fn keyframe(list: &VoxelList, stamp: &MapStamp) -> Vec<LatticeMap> {
    let keys = list.sorted_keys();
    let parts = split(&keys, payload_bytes(list), stamp.chunk_bytes);
    let payloads = |keys: &[MortonKey]| Payloads::of(list, keys);
    keyframe_of_parts(list.lattice(), list.datum_m(), &parts, stamp, payloads)
}

/// Keyframe of cells without payload.
pub fn keyframe_of_cells(
    lattice: &Lattice,
    datum_m: Vector3<f64>,
    keys: &[MortonKey],
    stamp: &MapStamp,
) -> Vec<LatticeMap> {
    let parts = split(keys, 0, stamp.chunk_bytes);
    keyframe_of_parts(lattice, datum_m, &parts, stamp, Payloads::of_cells)
}

fn keyframe_of_parts(
    lattice: &Lattice,
    datum_m: Vector3<f64>,
    parts: &[&[MortonKey]],
    stamp: &MapStamp,
    payloads: impl Fn(&[MortonKey]) -> Payloads,
) -> Vec<LatticeMap> {
    let info = info_of(lattice, datum_m, stamp);
    let total: usize = parts.iter().map(|keys| keys.len()).sum();
    let chunk = |(chunk, keys): (u32, &&[MortonKey])| {
        let payloads = payloads(keys);
        LatticeMap {
            header: stamp.header.clone(),
            info: info.clone(),
            sequence: stamp.sequence,
            chunk,
            chunks: parts.len() as u32,
            voxels_total: total as u64,
            key_encoding: payloads.key_encoding,
            voxels: keys.len() as u32,
            keys: payloads.keys,
            counts: payloads.counts,
            offset_unit_m: offset_unit_m(lattice),
            mean_offsets: payloads.mean_offsets,
            labels: payloads.labels,
            label_counts: payloads.label_counts,
            history_checksum: stamp.history.0,
        }
    };
    let chunks = (0..).zip(parts).map(chunk);
    let mut chunks: Vec<_> = chunks.take_while(|_| !stamp.hurry.is_requested()).collect();
    if chunks.len() < parts.len() {
        chunks.clear();
    }
    chunks
}

/// Update since `previous_sequence` with the state of each changed voxel, in chunks.
pub fn update(
    list: &VoxelList,
    changes: &Changes,
    previous_sequence: u64,
    stamp: &MapStamp,
) -> Vec<LatticeMapUpdate> {
    let (place, bytes) = ((list.lattice(), list.datum_m()), payload_bytes(list));
    let payloads = |keys: &[MortonKey]| Payloads::of(list, keys);
    update_of_parts(place, changes, bytes, previous_sequence, stamp, payloads)
}

/// Update of cells without payload.
pub fn update_of_cells(
    lattice: &Lattice,
    datum_m: Vector3<f64>,
    changes: &Changes,
    previous_sequence: u64,
    stamp: &MapStamp,
) -> Vec<LatticeMapUpdate> {
    let (place, cells) = ((lattice, datum_m), Payloads::of_cells);
    update_of_parts(place, changes, 0, previous_sequence, stamp, cells)
}

fn update_of_parts(
    (lattice, datum_m): (&Lattice, Vector3<f64>),
    changes: &Changes,
    payload_bytes: usize,
    previous_sequence: u64,
    stamp: &MapStamp,
    payloads: impl Fn(&[MortonKey]) -> Payloads,
) -> Vec<LatticeMapUpdate> {
    let template = LatticeMapUpdate {
        header: stamp.header.clone(),
        info: info_of(lattice, datum_m, stamp),
        offset_unit_m: offset_unit_m(lattice),
        previous_sequence,
        sequence: stamp.sequence,
        key_encoding: KEY_ENCODING.to_owned(),
        ..LatticeMapUpdate::default()
    };
    let mut out = Vec::new();
    let changed = split(&changes.changed, payload_bytes, stamp.chunk_bytes);
    for keys in changed.into_iter().filter(|keys| !keys.is_empty()) {
        let payloads = payloads(keys);
        out.push(LatticeMapUpdate {
            voxels: keys.len() as u32,
            key_encoding: payloads.key_encoding,
            keys: payloads.keys,
            counts: payloads.counts,
            mean_offsets: payloads.mean_offsets,
            labels: payloads.labels,
            label_counts: payloads.label_counts,
            ..template.clone()
        });
    }
    let removed = split(&changes.removed, 0, stamp.chunk_bytes);
    for keys in removed.into_iter().filter(|keys| !keys.is_empty()) {
        out.push(LatticeMapUpdate {
            removed: keys.len() as u32,
            removed_keys: ByteBuf::from(codec::encode_keys(keys)),
            ..template.clone()
        });
    }
    let chunks = out.len() as u32;
    for (chunk, message) in (0..).zip(&mut out) {
        message.chunk = chunk;
        message.chunks = chunks;
    }
    out
}

/// Unit of mean offsets: the covering radius of the cell fits 16 bits.
fn offset_unit_m(lattice: &Lattice) -> f64 {
    lattice.covering_radius_m() / f64::from(i16::MAX)
}

fn mean_offsets<'a>(voxels: impl Iterator<Item = &'a Voxel>, unit_m: f64) -> Vec<i16> {
    voxels
        .flat_map(Voxel::mean_offset_m)
        .map(|offset_m| (offset_m / unit_m).round() as i16)
        .collect()
}

/// Bytes of a voxel besides its key.
fn payload_bytes(list: &VoxelList) -> usize {
    let kept = list.payload();
    let of = |kept: bool, bytes: usize| if kept { bytes } else { 0 };
    PAYLOAD_BYTES + of(kept.labels, LABEL_BYTES) + of(kept.color, COLOR_BYTES)
}

/// Splits sorted keys so that each part fits `chunk_bytes`; at least one part, of at least one key.
fn split(keys: &[MortonKey], payload_bytes: usize, chunk_bytes: usize) -> Vec<&[MortonKey]> {
    let room = chunk_bytes
        .saturating_sub(CHUNK_OVERHEAD_BYTES)
        .max(CHUNK_OVERHEAD_BYTES);
    let mut parts = Vec::new();
    let mut start = 0;
    let mut used = 0;
    let mut previous = 0;
    for (i, key) in keys.iter().enumerate() {
        let before = if i == start { 0 } else { previous };
        let bytes = varint_len(key.raw() - before) + payload_bytes;
        if i > start && used + bytes > room {
            parts.push(&keys[start..i]);
            start = i;
            used = varint_len(key.raw()) + payload_bytes;
        } else {
            used += bytes;
        }
        previous = key.raw();
    }
    parts.push(&keys[start..]);
    parts
}

/// Bytes of the voxels in a keyframe of one chunk, without its header. `list` has their payload; `None`: keys only.
pub fn voxel_bytes(keys: &[MortonKey], list: Option<&VoxelList>) -> usize {
    let mut before = 0;
    let mut bytes = keys.len() * list.map_or(0, payload_bytes);
    for key in keys {
        bytes += varint_len(key.raw() - before);
        before = key.raw();
    }
    bytes
}

fn varint_len(value: u64) -> usize {
    (64 - (value | 1).leading_zeros()).div_ceil(7) as usize
}
