//! Checksum of the updates of an epoch, by which a follower verifies that it has received exactly these updates.
//! `msgs/msg/LatticeMapUpdate.msg` defines it.

use lattice_core::lattice::MortonKey;
use lattice_msgs::lattice::LatticeMapUpdate;

use super::colors::VoxelColor;
use super::voxels::{Decoded, VoxelColumns, keys_from, voxels_from};

/// Checksum of all updates up to a state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct History(pub u64);

impl History {
    /// Checksum after one more update, whose chunk sums add up to `sum`.
    pub fn then(self, sequence: u64, sum: u64) -> History {
        History(mix(self.0.wrapping_add(sequence).wrapping_add(sum)))
    }
}

/// Sum over a chunk of an update; the total is independent of the order of chunks.
pub fn changes_sum(changed: &Decoded, removed: &[MortonKey]) -> u64 {
    let mut colors = changed.colors.iter().peekable();
    let voxels = changed.voxels.iter().map(|(key, state)| {
        let [x, y, z] = state.mean_offset.map(|v| u64::from(v.cast_unsigned()));
        let mean = u64::from(state.count) | x << 32 | y << 48;
        let label = z | u64::from(state.label) << 16 | u64::from(state.label_count) << 32;
        let sum = mix(mix(mix(key.raw()) ^ mean) ^ label);
        match colors.next_if(|(colored, _)| colored == key) {
            Some((_, VoxelColor { count, rgb })) => {
                let [r, g, b] = rgb.map(u64::from);
                mix(sum ^ (r | g << 8 | b << 16 | u64::from(*count) << 32))
            }
            None => sum,
        }
    });
    let removed = removed.iter().map(|key| mix(!key.raw()));
    voxels.chain(removed).fold(0, u64::wrapping_add)
}

/// Writes the checksum after an update into all its chunks, and returns it.
pub fn sign(
    chunks: &mut [LatticeMapUpdate],
    before: History,
    sequence: u64,
    voxels: usize,
) -> History {
    let sum = |chunk: &LatticeMapUpdate| {
        let columns = VoxelColumns::from(chunk);
        let voxels = voxels_from(columns, usize::MAX).unwrap_or_default();
        let removed = keys_from(columns.key_encoding, &chunk.removed_keys, usize::MAX);
        changes_sum(&voxels, &removed.unwrap_or_default())
    };
    let sum = chunks.iter().map(sum).fold(0, u64::wrapping_add);
    let history = before.then(sequence, sum);
    for chunk in chunks {
        chunk.voxels_total = voxels as u64;
        chunk.history_checksum = history.0;
    }
    history
}

/// The finalizer of splitmix64 (Steele, Lea & Flood 2014).
fn mix(z: u64) -> u64 {
    let z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ z >> 31
}
