//! Voxel lists as `LatticeMap` keyframes and `LatticeMapUpdate` deltas of bounded size.

use lattice_core::lattice::{Lattice, LatticeKind, MortonKey};
use lattice_core::voxels::codec;
use lattice_core::voxels::{Changes, Voxel, VoxelList};
use lattice_msgs::geographic_msgs::GeoPoint;
use lattice_msgs::lattice::{LatticeInfo, LatticeMap, LatticeMapUpdate};
use lattice_msgs::std_msgs::Header;
use nalgebra::{Isometry3, Matrix3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde_bytes::ByteBuf;
use thiserror::Error;

mod voxels;

pub use voxels::{VoxelColumns, VoxelState, keys_from, main_label, voxels_from};

use self::voxels::labels_of;
use super::geometry;

/// The one encoding of voxel keys: Morton-sorted 21-bit indices, LEB128 varints of differences.
pub const KEY_ENCODING: &str = "morton21_delta_leb128";

/// Bytes of a chunk that are not voxels: header, info, lengths. Generous.
const CHUNK_OVERHEAD_BYTES: usize = 1024;
/// Count and mean offset of one voxel.
const PAYLOAD_BYTES: usize = 4 + 3 * 2;
/// Label and label count of one voxel.
const LABEL_BYTES: usize = 2 + 4;
/// Tolerance of a generator, a cell volume and a quaternion, relative to their size.
const TOLERANCE: f64 = 1e-9;

/// Error of a `LatticeMap` or `LatticeMapUpdate` that cannot be used.
#[derive(Debug, Error)]
pub enum MapMessageError {
    /// The lattice or its cell volume means nothing here.
    #[error("lattice '{lattice}' with cell volume {cell_volume_m3} m^3: {reason}")]
    Lattice {
        /// Name as sent.
        lattice: String,
        /// Cell volume as sent.
        cell_volume_m3: f64,
        /// Problem in words.
        reason: String,
    },
    /// Keys in an encoding that this version does not read.
    #[error("key encoding '{0}' is unknown, expected '{KEY_ENCODING}'")]
    Encoding(String),
    /// Keys that do not decode.
    #[error("voxel keys: {0}")]
    Keys(#[from] codec::CodecError),
    /// Columns of different length.
    #[error("{column} has {found} entries for {voxels} voxels, expected {expected}")]
    Length {
        /// Name of the column.
        column: &'static str,
        /// Number of voxels that the keys give.
        voxels: usize,
        /// Entries there should be.
        expected: usize,
        /// Entries there are.
        found: usize,
    },
    /// Chunk number outside of the number of chunks.
    #[error("chunk {chunk} of {chunks}")]
    Chunk {
        /// As sent, counted from zero.
        chunk: u32,
        /// As sent.
        chunks: u32,
    },
    /// The frame of the lattice in the map is not a pose.
    #[error("map_from_lattice is not a pose: a number is not finite or the rotation is zero")]
    Frame,
}

/// Header and state that all messages of one map state share.
pub struct MapStamp<'a> {
    /// Frame and time.
    pub header: Header,
    /// Changes when the map is reset.
    pub epoch: u64,
    /// State that the message describes.
    pub sequence: u64,
    /// Geodetic origin of the map frame, where known.
    pub origin: Option<&'a GeoPoint>,
    /// Largest serialised chunk.
    pub chunk_bytes: usize,
}

/// The lattice, its place in the map frame and the epoch, as a message: the generator in the
/// lattice's own axes, which `map_from_lattice` turns.
pub fn info_of(lattice: &Lattice, datum_m: Vector3<f64>, stamp: &MapStamp) -> LatticeInfo {
    let g = lattice.unoriented_generator().transpose();
    let mut generator = [0.0; 9];
    generator.copy_from_slice(g.as_slice());
    let datum = Isometry3::from_parts(Translation3::from(datum_m), lattice.orientation());
    LatticeInfo {
        lattice: lattice.kind().name().to_owned(),
        cell_volume_m3: lattice.cell_volume_m3(),
        generator,
        map_from_lattice: geometry::pose_from(&datum),
        origin: stamp.origin.copied().unwrap_or_default(),
        has_origin: stamp.origin.is_some(),
        epoch: stamp.epoch,
    }
}

/// The lattice of a message, turned as it lies in the map, and its datum in the map frame.
///
/// Refused if generator, name and cell volume do not agree; a custom lattice is that of its generator.
pub fn lattice_from(info: &LatticeInfo) -> Result<(Lattice, Vector3<f64>), MapMessageError> {
    let refuse = |reason: String| MapMessageError::Lattice {
        lattice: info.lattice.chars().take(32).collect(),
        cell_volume_m3: info.cell_volume_m3,
        reason,
    };
    let generator = Matrix3::from_row_slice(&info.generator);
    let lattice = if info.lattice == LatticeKind::Custom.name() {
        Lattice::from_basis(generator)
    } else {
        let kind = info.lattice.parse::<LatticeKind>();
        kind.and_then(|kind| Lattice::new(kind, info.cell_volume_m3))
    };
    let lattice = lattice.map_err(|e| refuse(format!("{e}")))?;
    let volume_m3 = lattice.cell_volume_m3();
    let volume_off = (info.cell_volume_m3 - volume_m3).abs() / volume_m3;
    let generator_off = (generator - lattice.unoriented_generator()).abs().sum();
    let agrees = volume_off <= TOLERANCE && generator_off <= TOLERANCE * lattice.cell_side_m();
    if !agrees {
        let expected = lattice.unoriented_generator();
        return Err(refuse(format!(
            "generator and volume are not those of the lattice, {:?} row by row and {volume_m3} m^3",
            expected.transpose().as_slice()
        )));
    }
    let place =
        geometry::isometry_from_pose(&info.map_from_lattice).ok_or(MapMessageError::Frame)?;
    let q = &info.map_from_lattice.orientation;
    let sent = Quaternion::new(q.w, q.x, q.y, q.z);
    // As sent, to the bit, where it is of length 1 but for rounding.
    let rotation = if (sent.norm_squared() - 1.0).abs() <= TOLERANCE {
        UnitQuaternion::new_unchecked(sent)
    } else {
        place.rotation
    };
    Ok((lattice.oriented(rotation), place.translation.vector))
}

/// Payload of the voxels of a chunk, empty where not kept.
#[derive(Default)]
struct Payloads {
    counts: Vec<u32>,
    mean_offsets: Vec<i16>,
    labels: Vec<u16>,
    label_counts: Vec<u32>,
}

impl Payloads {
    fn of<'a>(
        list: &VoxelList,
        keys: &[MortonKey],
        voxels: impl Iterator<Item = &'a Voxel> + Clone,
    ) -> Self {
        let (labels, label_counts) = labels_of(list, keys);
        Self {
            counts: voxels.clone().map(|voxel| voxel.count).collect(),
            mean_offsets: mean_offsets(voxels, offset_unit_m(list.lattice())),
            labels,
            label_counts,
        }
    }
}

/// The whole list as self-contained chunks; an empty list is one chunk without voxels.
pub fn keyframe(list: &VoxelList, stamp: &MapStamp) -> Vec<LatticeMap> {
    let voxels = list.sorted();
    let keys: Vec<MortonKey> = voxels.iter().map(|(key, _)| *key).collect();
    let parts = split(&keys, payload_bytes(list), stamp.chunk_bytes);
    let mut rest = voxels.as_slice();
    keyframe_of_parts(list.lattice(), list.datum_m(), &parts, stamp, |keys| {
        let (voxels, tail) = rest.split_at(keys.len().min(rest.len()));
        rest = tail;
        Payloads::of(list, keys, voxels.iter().map(|(_, voxel)| voxel))
    })
}

/// The same of cells without payload.
pub fn keyframe_of_cells(
    lattice: &Lattice,
    datum_m: Vector3<f64>,
    keys: &[MortonKey],
    stamp: &MapStamp,
) -> Vec<LatticeMap> {
    let parts = split(keys, 0, stamp.chunk_bytes);
    keyframe_of_parts(lattice, datum_m, &parts, stamp, |_| Payloads::default())
}

fn keyframe_of_parts(
    lattice: &Lattice,
    datum_m: Vector3<f64>,
    parts: &[&[MortonKey]],
    stamp: &MapStamp,
    mut payloads: impl FnMut(&[MortonKey]) -> Payloads,
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
            key_encoding: KEY_ENCODING.to_owned(),
            voxels: keys.len() as u32,
            keys: ByteBuf::from(codec::encode_keys(keys)),
            counts: payloads.counts,
            offset_unit_m: offset_unit_m(lattice),
            mean_offsets: payloads.mean_offsets,
            labels: payloads.labels,
            label_counts: payloads.label_counts,
        }
    };
    (0..).zip(parts).map(chunk).collect()
}

/// Changes since `previous_sequence`, with the state of each changed voxel, in chunks.
pub fn update(
    list: &VoxelList,
    changes: &Changes,
    previous_sequence: u64,
    stamp: &MapStamp,
) -> Vec<LatticeMapUpdate> {
    let place = (list.lattice(), list.datum_m());
    let payload_bytes = payload_bytes(list);
    update_of_parts(
        place,
        changes,
        payload_bytes,
        previous_sequence,
        stamp,
        |keys| {
            let voxel = |key: &MortonKey| list.get(*key).unwrap_or_default();
            let voxels: Vec<Voxel> = keys.iter().map(voxel).collect();
            Payloads::of(list, keys, voxels.iter())
        },
    )
}

/// The same of cells without payload.
pub fn update_of_cells(
    lattice: &Lattice,
    datum_m: Vector3<f64>,
    changes: &Changes,
    previous_sequence: u64,
    stamp: &MapStamp,
) -> Vec<LatticeMapUpdate> {
    let none = |_: &[MortonKey]| Payloads::default();
    update_of_parts(
        (lattice, datum_m),
        changes,
        0,
        previous_sequence,
        stamp,
        none,
    )
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
    if !changes.changed.is_empty() {
        for keys in split(&changes.changed, payload_bytes, stamp.chunk_bytes) {
            let payloads = payloads(keys);
            out.push(LatticeMapUpdate {
                voxels: keys.len() as u32,
                keys: ByteBuf::from(codec::encode_keys(keys)),
                counts: payloads.counts,
                mean_offsets: payloads.mean_offsets,
                labels: payloads.labels,
                label_counts: payloads.label_counts,
                ..template.clone()
            });
        }
    }
    if !changes.removed.is_empty() {
        for keys in split(&changes.removed, 0, stamp.chunk_bytes) {
            out.push(LatticeMapUpdate {
                removed: keys.len() as u32,
                removed_keys: ByteBuf::from(codec::encode_keys(keys)),
                ..template.clone()
            });
        }
    }
    let chunks = out.len() as u32;
    for (chunk, message) in (0..).zip(&mut out) {
        message.chunk = chunk;
        message.chunks = chunks;
    }
    out
}

/// Unit of mean offsets: the farthest a point can be from its cell centre fits 16 bits.
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
    PAYLOAD_BYTES
        + if list.payload().labels {
            LABEL_BYTES
        } else {
            0
        }
}

/// Cuts sorted keys so that each part fits `chunk_bytes`; at least one part, of at least one key.
fn split(keys: &[MortonKey], payload_bytes: usize, chunk_bytes: usize) -> Vec<&[MortonKey]> {
    let room = chunk_bytes
        .saturating_sub(CHUNK_OVERHEAD_BYTES)
        .max(CHUNK_OVERHEAD_BYTES);
    let mut parts = Vec::new();
    let mut start = 0;
    let mut used = 0;
    let mut previous = 0;
    for (i, key) in keys.iter().enumerate() {
        let difference = if i == start {
            key.raw()
        } else {
            key.raw() - previous
        };
        let bytes = varint_len(difference) + payload_bytes;
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

fn varint_len(value: u64) -> usize {
    (64 - (value | 1).leading_zeros()).div_ceil(7) as usize
}

#[cfg(test)]
mod tests;
