//! Voxels as columns of a message.

use lattice_core::lattice::MortonKey;
use lattice_core::registration::UNLABELED;
use lattice_core::voxels::{VoxelList, codec};
use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};

use super::colors::{VoxelColor, decode_colors, part_colors};
use super::error::MapMessageError;

/// Voxel as a consumer receives it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoxelState {
    /// Points in the cell; 1 if they are not counted.
    pub count: u32,
    /// Mean of the points relative to the cell centre, in units of the message.
    pub mean_offset: [i16; 3],
    /// Most frequent label; [`UNLABELED`] if none.
    pub label: u16,
    /// Points with that label.
    pub label_count: u32,
}

/// Voxels of a message.
#[derive(Debug, Default)]
pub struct Decoded {
    /// Voxels in the order of their keys.
    pub voxels: Vec<(MortonKey, VoxelState)>,
    /// Colours of those that have one, in the same order.
    pub colors: Vec<(MortonKey, VoxelColor)>,
}

/// Voxel columns of a message; empty if not kept.
#[derive(Clone, Copy, Debug)]
pub struct VoxelColumns<'a> {
    /// Encoding of the keys.
    pub key_encoding: &'a str,
    /// Number of voxels.
    pub voxels: u32,
    /// Keys, and colours if the encoding has them.
    pub keys: &'a [u8],
    /// Points.
    pub counts: &'a [u32],
    /// Three mean offsets each.
    pub mean_offsets: &'a [i16],
    /// Most frequent labels.
    pub labels: &'a [u16],
    /// Counts of these labels.
    pub label_counts: &'a [u32],
}

impl<'a> From<&'a LatticeMap> for VoxelColumns<'a> {
    fn from(message: &'a LatticeMap) -> Self {
        Self {
            key_encoding: &message.key_encoding,
            voxels: message.voxels,
            keys: &message.keys,
            counts: &message.counts,
            mean_offsets: &message.mean_offsets,
            labels: &message.labels,
            label_counts: &message.label_counts,
        }
    }
}

impl<'a> From<&'a LatticeMapUpdate> for VoxelColumns<'a> {
    fn from(message: &'a LatticeMapUpdate) -> Self {
        Self {
            key_encoding: &message.key_encoding,
            voxels: message.voxels,
            keys: &message.keys,
            counts: &message.counts,
            mean_offsets: &message.mean_offsets,
            labels: &message.labels,
            label_counts: &message.label_counts,
        }
    }
}

/// Voxels of a keyframe chunk, or of the changed part of an update.
pub fn voxels_from(columns: VoxelColumns, max_voxels: usize) -> Result<Decoded, MapMessageError> {
    let (keys, colors) = part_colors(columns.key_encoding, columns.keys, columns.voxels)?;
    let keys = codec::decode_keys(keys, max_voxels)?;
    let colors = colors.map_or(Ok(Vec::new()), |colors| decode_colors(colors, &keys))?;
    let check = |column, expected, found| {
        if expected == found {
            Ok(())
        } else {
            Err(MapMessageError::Length {
                column,
                voxels: keys.len(),
                expected,
                found,
            })
        }
    };
    let counted = !(columns.counts.is_empty() && columns.mean_offsets.is_empty());
    if counted {
        check("counts", keys.len(), columns.counts.len())?;
        check("mean_offsets", keys.len() * 3, columns.mean_offsets.len())?;
    }
    let labelled = !(columns.labels.is_empty() && columns.label_counts.is_empty());
    if labelled {
        check("labels", keys.len(), columns.labels.len())?;
        check("label_counts", keys.len(), columns.label_counts.len())?;
    }
    let labels = columns.labels.iter().zip(columns.label_counts);
    let labels = labels.map(|(label, count)| (*label, *count));
    let labels = labels.chain(std::iter::repeat((UNLABELED, 0)));
    let offsets = columns.mean_offsets.chunks_exact(3);
    let offsets = offsets.map(|offset| <[i16; 3]>::try_from(offset).unwrap_or_default());
    let payloads = columns.counts.iter().copied().zip(offsets);
    // Occupancy maps have no payload: one point at the centre.
    let payloads = payloads.chain(std::iter::repeat((1, [0; 3])));
    let voxels = keys.into_iter().zip(payloads).zip(labels);
    let voxels = voxels
        .map(|((key, (count, mean_offset)), (label, label_count))| {
            let state = VoxelState {
                count,
                mean_offset,
                label,
                label_count,
            };
            (key, state)
        })
        .collect();
    Ok(Decoded { voxels, colors })
}

/// Keys without colours of a message: those of removed voxels.
pub fn keys_from(
    key_encoding: &str,
    keys: &[u8],
    max_voxels: usize,
) -> Result<Vec<MortonKey>, MapMessageError> {
    // No voxels: only the name of the encoding is validated.
    part_colors(key_encoding, &[], 0)?;
    Ok(codec::decode_keys(keys, max_voxels)?)
}

/// The columns `labels` and `label_counts`, empty if labels are not kept.
pub(super) fn labels_of(list: &VoxelList, keys: &[MortonKey]) -> (Vec<u16>, Vec<u32>) {
    if !list.payload().labels {
        return (Vec::new(), Vec::new());
    }
    let labels = keys.iter().map(|key| main_label(list, *key));
    labels.unzip()
}

/// Most frequent label of a cell, the smallest of equals, with its count; [`UNLABELED`] and 0 if
/// no point is labelled.
pub fn main_label(list: &VoxelList, key: MortonKey) -> (u16, u32) {
    let labels = list
        .labels(key)
        .into_iter()
        .filter(|l| l.label != UNLABELED);
    let main = labels.min_by_key(|counted| (std::cmp::Reverse(counted.count), counted.label));
    main.map_or((UNLABELED, 0), |counted| (counted.label, counted.count))
}
