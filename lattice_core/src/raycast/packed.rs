//! Lattice index in one word that steps by one addition and splits into blocks.

use crate::lattice::{LatticeIndex, MortonKey};

const BITS: u32 = 21;
const OFFSET: i64 = 1 << (BITS - 1);
const FIELD: u64 = (1 << BITS) - 1;

/// Low three bits of each axis: the position in a block of 8 x 8 x 8.
const PLACE: u64 = 7 | 7 << BITS | 7 << (2 * BITS);

/// Multiplier by which the fields of a position stand side by side from bit `2 * BITS` on.
const GATHER: u64 = 1 << (2 * BITS) | 1 << (BITS + 3) | 1 << 6;

/// The three entries of a lattice index plus 2^20, 21 bits each, the first lowest.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub(super) struct Packed(pub(super) u64);

impl Packed {
    /// Packs an index; `None` if an entry is outside `-2^20 ..= 2^20 - 1`.
    #[inline]
    pub(super) fn new(w: LatticeIndex) -> Option<Packed> {
        let [x, y, z] = w.map(|i| (i64::from(i) + OFFSET) as u64);
        ((x | y | z) >> BITS == 0).then_some(Packed(x | y << BITS | z << (2 * BITS)))
    }

    #[inline]
    pub(super) fn unpack(self) -> LatticeIndex {
        [0, BITS, 2 * BITS].map(|shift| ((self.0 >> shift & FIELD) as i64 - OFFSET) as i32)
    }

    /// Index advanced by `step`, see [`difference`]; the caller keeps it in range.
    #[inline(always)]
    pub(super) fn plus(self, step: u64) -> Packed {
        Packed(self.0.wrapping_add(step))
    }

    /// Block that contains the index, as the packed index of its first cell.
    #[inline(always)]
    pub(super) fn block(self) -> u64 {
        self.0 & !PLACE
    }

    /// Position in the block, below 512, the first axis fastest.
    #[inline(always)]
    pub(super) fn place(self) -> usize {
        // One multiplication moves the three fields side by side; their other images do not reach these bits.
        ((self.0 & PLACE).wrapping_mul(GATHER) >> (2 * BITS)) as usize & 0o777
    }

    /// Index at a position of a block.
    #[inline]
    pub(super) fn at(block: u64, place: usize) -> Packed {
        let p = place as u64;
        Packed(block | (p & 7) | (p & 0o70) << (BITS - 3) | (p & 0o700) << (2 * BITS - 6))
    }

    #[inline]
    pub(super) fn key(self) -> Option<MortonKey> {
        MortonKey::pack(self.unpack())
    }
}

/// Packs a difference of indices as an addend to a packed index.
pub(super) fn difference(w: LatticeIndex) -> u64 {
    let [x, y, z] = w.map(i64::from);
    (x + (y << BITS) + (z << (2 * BITS))) as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn steps_and_places_are_those_of_the_index(
            w in prop::array::uniform3(-1_000_000..1_000_000_i32),
            d in prop::array::uniform3(-9..9_i32),
        ) {
            let packed = Packed::new(w).unwrap();
            prop_assert_eq!(packed.unpack(), w);
            let moved = [w[0] + d[0], w[1] + d[1], w[2] + d[2]];
            prop_assert_eq!(packed.plus(difference(d)).unpack(), moved);
            prop_assert_eq!(packed.key(), MortonKey::pack(w));
            let place = w.map(|i| i.rem_euclid(8) as usize);
            prop_assert_eq!(packed.place(), place[0] + 8 * place[1] + 64 * place[2]);
            prop_assert_eq!(Packed::at(packed.block(), packed.place()), packed);
            let first = Packed(packed.block()).unpack();
            prop_assert_eq!(first, w.map(|i| i.div_euclid(8) * 8));
        }
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        for w in [[1 << 20, 0, 0], [0, -(1 << 20) - 1, 0], [0, 0, i32::MAX]] {
            assert_eq!(Packed::new(w), None);
        }
    }
}
