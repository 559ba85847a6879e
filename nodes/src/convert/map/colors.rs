//! Mean colours of voxels, which follow the keys in the bytes of a message.

use lattice_core::lattice::MortonKey;
use lattice_core::voxels::{ColorSum, VoxelList, codec};
use serde_bytes::ByteBuf;

use super::error::{COLOR_ENCODING, KEY_ENCODING, MapMessageError};

/// Mean colour of the coloured points of a voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VoxelColor {
    /// Number of coloured points, not 0.
    pub count: u32,
    /// Mean red, green and blue.
    pub rgb: [u8; 3],
}

impl VoxelColor {
    /// Colour of sums; `None` if they have no mean.
    pub fn of(sum: &ColorSum) -> Option<VoxelColor> {
        let (count, rgb) = (sum.count, sum.mean()?);
        Some(VoxelColor { count, rgb })
    }

    /// Colour of a cell of a list; `None` if it has none.
    pub fn of_cell(list: &VoxelList, key: MortonKey) -> Option<VoxelColor> {
        VoxelColor::of(&list.color(key)?)
    }
}

/// Keys of a message with the colours of the voxels after them, and the name of that encoding.
pub fn keys_with_colors(
    keys: &[MortonKey],
    color: impl Fn(MortonKey) -> Option<VoxelColor>,
) -> (ByteBuf, String) {
    let colors: Vec<_> = keys.iter().map(|key| color(*key)).collect();
    let counts: Vec<u32> = colors.iter().map(|c| c.map_or(0, |c| c.count)).collect();
    let mut bytes = codec::encode_keys(keys);
    bytes.extend(codec::encode_counts(&counts));
    bytes.extend(colors.iter().flatten().flat_map(|color| color.rgb));
    (ByteBuf::from(bytes), COLOR_ENCODING.to_owned())
}

/// Keys of a message without colours, and the name of that encoding.
pub fn plain_keys(keys: &[MortonKey]) -> (ByteBuf, String) {
    let bytes = ByteBuf::from(codec::encode_keys(keys));
    (bytes, KEY_ENCODING.to_owned())
}

/// Parts the bytes of `voxels` keys from those of the colours; these are `None` without colours.
pub fn part_colors<'a>(
    key_encoding: &str,
    bytes: &'a [u8],
    voxels: u32,
) -> Result<(&'a [u8], Option<&'a [u8]>), MapMessageError> {
    match key_encoding {
        KEY_ENCODING => Ok((bytes, None)),
        COLOR_ENCODING => {
            let (keys, colors) = codec::split_numbers(bytes, voxels as usize)?;
            Ok((keys, Some(colors)))
        }
        other => Err(MapMessageError::Encoding(other.chars().take(64).collect())),
    }
}

/// Colours of the cells that have one, in the order of the keys.
pub(super) fn decode_colors(
    bytes: &[u8],
    keys: &[MortonKey],
) -> Result<Vec<(MortonKey, VoxelColor)>, MapMessageError> {
    let (counts, rgb) = codec::decode_counts(bytes, keys.len())?;
    let colored = keys.iter().zip(counts).filter(|(_, count)| *count > 0);
    let triples = rgb.as_chunks::<3>().0.iter();
    let colors: Vec<_> = colored
        .clone()
        .zip(triples)
        .map(|((key, count), rgb)| (*key, VoxelColor { count, rgb: *rgb }))
        .collect();
    let expected = 3 * colored.count();
    match rgb.len() == expected {
        true => Ok(colors),
        false => Err(MapMessageError::Length {
            column: "colours",
            voxels: keys.len(),
            expected,
            found: rgb.len(),
        }),
    }
}
