//! Block key of a cell: an integer that orders cells block by block.

use super::{LatticeIndex, MortonKey};

const OFFSET: i32 = 1 << 20;
/// Bits of a block coordinate: 21 without the three of the position in the block.
const BLOCK_BITS: u32 = 18;
const BLOCK_MASK: u64 = (1 << BLOCK_BITS) - 1;

/// Cell as a block and a position in it; blocks have 8 x 8 x 8 lattice indices.
///
/// Faster to compute than a [`MortonKey`] and used inside the stores; it holds the same index. From the top:
/// `w_i + 2^20` without its three low bits for i = 0, 1, 2 (18 bits each), then those low bits.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct BlockKey(u64);

impl BlockKey {
    /// Key of a point without a cell.
    pub const NONE: BlockKey = BlockKey(u64::MAX);

    /// Number of cells in a block.
    pub const BLOCK_CELLS: usize = 512;

    /// Key of a lattice index; `None` if an entry is outside `-2^20 ..= 2^20 - 1`.
    #[inline]
    pub fn pack(w: LatticeIndex) -> Option<BlockKey> {
        let v = w.map(|i| i.wrapping_add(OFFSET) as u32);
        ((v[0] | v[1] | v[2]) >> 21 == 0).then(|| BlockKey::from_halves(BlockKey::halves(v)))
    }

    /// Lattice index of the key; meaningless for [`BlockKey::NONE`].
    #[inline]
    pub fn unpack(self) -> LatticeIndex {
        let local = self.place() as i32;
        let block = self.block();
        let axis = |block: u64, low: i32| ((block & BLOCK_MASK) << 3) as i32 + (low & 7) - OFFSET;
        [
            axis(block >> (2 * BLOCK_BITS), local >> 6),
            axis(block >> BLOCK_BITS, local >> 3),
            axis(block, local),
        ]
    }

    /// Morton key of the cell. [`BlockKey::NONE`] yields the last cell, so exclude it before.
    #[inline]
    pub fn key(self) -> Option<MortonKey> {
        MortonKey::pack(self.unpack())
    }

    /// Integer value, below 2^63 except for [`BlockKey::NONE`].
    #[inline]
    pub fn raw(self) -> u64 {
        self.0
    }

    /// Key of an integer; `None` from 2^63 on.
    #[inline]
    pub fn from_raw(raw: u64) -> Option<BlockKey> {
        (raw >> 63 == 0).then_some(BlockKey(raw))
    }

    /// Low and high half of the key of indices offset by 2^20, each below 2^21; for eight lanes of 32 bits.
    #[inline(always)]
    pub fn halves([x, y, z]: [u32; 3]) -> [u32; 2] {
        let local = (x & 7) << 6 | (y & 7) << 3 | (z & 7);
        let (x, y, z) = (x >> 3, y >> 3, z >> 3);
        [local | z << 9 | y << 27, y >> 5 | x << 13]
    }

    /// Key of a low and a high half from [`BlockKey::halves`].
    #[inline(always)]
    pub fn from_halves([low, high]: [u32; 2]) -> BlockKey {
        BlockKey(u64::from(high) << 32 | u64::from(low))
    }

    /// Number of the block, below 2^54 except for [`BlockKey::NONE`]; blocks are ordered as their keys.
    #[inline]
    pub fn block(self) -> u64 {
        self.0 >> 9
    }

    /// Position in the block, below [`BlockKey::BLOCK_CELLS`].
    #[inline]
    pub fn place(self) -> usize {
        (self.0 & 511) as usize
    }
}

impl From<MortonKey> for BlockKey {
    #[inline]
    fn from(key: MortonKey) -> BlockKey {
        BlockKey::from_halves(BlockKey::halves(key.unpack().map(|i| (i + OFFSET) as u32)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_layout_is_that_of_the_description() {
        let low = -(1 << 20);
        let raw = |w| BlockKey::pack(w).unwrap().raw();
        assert_eq!(raw([low; 3]), 0);
        assert_eq!(raw([low + 1, low + 2, low + 3]), 0o123);
        assert_eq!(raw([low, low, low + 8]), 1 << 9);
        assert_eq!(raw([low, low + 8, low]), 1 << 27);
        assert_eq!(raw([low + 8, low, low]), 1 << 45);
        assert_eq!(raw([(1 << 20) - 1; 3]), (1 << 63) - 1);
        for outside in [low - 1, 1 << 20, i32::MIN, i32::MAX] {
            assert_eq!(BlockKey::pack([0, outside, 0]), None);
        }
    }

    proptest! {
        #[test]
        fn codes_and_keys_hold_the_same_index(raw in 0_u64..1 << 63) {
            let code = BlockKey::from_raw(raw).unwrap();
            prop_assert_eq!(BlockKey::pack(code.unpack()), Some(code));
            let key = code.key().unwrap();
            prop_assert_eq!(key.unpack(), code.unpack());
            prop_assert_eq!(BlockKey::from(key), code);
        }
    }
}
