//! Morton key of a cell: its index with interleaved bits.

use super::LatticeIndex;

const BITS: u32 = 21;
const OFFSET: i64 = 1 << (BITS - 1);

/// Cell as one integer: the Morton interleave of `w_i + 2^20`, 21 bits each, bit 0 from `w_0`.
///
/// Keys close in value are close in space, so sorted keys have small differences.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct MortonKey(u64);

impl MortonKey {
    /// Key of a lattice index; `None` if an entry is outside `-2^20 ..= 2^20 - 1`.
    #[inline]
    pub fn pack(w: LatticeIndex) -> Option<MortonKey> {
        let [x, y, z] = w.map(|i| (i64::from(i) + OFFSET) as u64);
        ((x | y | z) >> BITS == 0).then(|| MortonKey(spread(x) | spread(y) << 1 | spread(z) << 2))
    }

    /// Lattice index of the key.
    #[inline]
    pub fn unpack(self) -> LatticeIndex {
        [0, 1, 2].map(|axis| (gather(self.0 >> axis) as i64 - OFFSET) as i32)
    }

    /// Integer value, below 2^63.
    #[inline]
    pub fn raw(self) -> u64 {
        self.0
    }

    /// Key of an integer; `None` from 2^63 on.
    #[inline]
    pub fn from_raw(raw: u64) -> Option<MortonKey> {
        (raw >> (3 * BITS) == 0).then_some(MortonKey(raw))
    }
}

/// Moves bit i of 21 bits to bit 3 i.
#[inline]
fn spread(mut v: u64) -> u64 {
    v = (v | v << 32) & 0x001f_0000_0000_ffff;
    v = (v | v << 16) & 0x001f_0000_ff00_00ff;
    v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
    v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
    (v | v << 2) & 0x1249_2492_4924_9249
}

/// Inverse of `spread`; other bits are ignored.
#[inline]
fn gather(mut v: u64) -> u64 {
    v &= 0x1249_2492_4924_9249;
    v = (v | v >> 2) & 0x10c3_0c30_c30c_30c3;
    v = (v | v >> 4) & 0x100f_00f0_0f00_f00f;
    v = (v | v >> 8) & 0x001f_0000_ff00_00ff;
    v = (v | v >> 16) & 0x001f_0000_0000_ffff;
    (v | v >> 32) & 0x001f_ffff
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn raw(w: LatticeIndex) -> Option<u64> {
        MortonKey::pack(w).map(MortonKey::raw)
    }

    #[test]
    fn the_range_is_21_bits_a_side() {
        let (low, high) = (-(1 << 20), (1 << 20) - 1);
        assert_eq!(raw([low; 3]), Some(0));
        assert_eq!(raw([high; 3]), Some((1 << 63) - 1));
        for axis in 0..3 {
            for outside in [low - 1, high + 1, i32::MIN, i32::MAX] {
                let mut w = [0; 3];
                w[axis] = outside;
                assert_eq!(MortonKey::pack(w), None);
            }
        }
        assert_eq!(MortonKey::from_raw(1 << 63), None);
    }

    #[test]
    fn bits_interleave_with_the_first_axis_lowest() {
        let low = -(1 << 20);
        assert_eq!(raw([low + 1, low, low]), Some(0b001));
        assert_eq!(raw([low, low + 1, low]), Some(0b010));
        assert_eq!(raw([low + 2, low, low + 1]), Some(0b001_100));
    }

    proptest! {
        #[test]
        fn pack_and_unpack_are_inverse(raw in 0_u64..1 << 63) {
            let key = MortonKey::from_raw(raw).unwrap();
            prop_assert_eq!(MortonKey::pack(key.unpack()), Some(key));
        }
    }
}
