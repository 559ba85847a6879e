//! Bit mask of a block, and the order of cells by their keys.

use rayon::slice::ParallelSliceMut;

use crate::lattice::{BlockKey, MortonKey};

/// Cells of a block, one bit per position.
pub(crate) type BlockMask = [u64; 8];

/// Low nine bits of the key of each position in a block.
static MORTON_OF_PLACE: [u16; BlockKey::BLOCK_CELLS] = {
    let mut table = [0; BlockKey::BLOCK_CELLS];
    let mut place = 0;
    while place < table.len() {
        let (mut bit, mut morton) = (0, 0);
        while bit < 3 {
            morton |= (place >> (6 + bit) & 1) << (3 * bit);
            morton |= (place >> (3 + bit) & 1) << (3 * bit + 1);
            morton |= (place >> bit & 1) << (3 * bit + 2);
            bit += 1;
        }
        table[place] = morton as u16;
        place += 1;
    }
    table
};

/// Inverse: position in a block of the low nine bits of a key.
static PLACE_OF_MORTON: [u16; BlockKey::BLOCK_CELLS] = {
    let mut table = [0; BlockKey::BLOCK_CELLS];
    let mut place = 0;
    while place < table.len() {
        table[MORTON_OF_PLACE[place] as usize] = place as u16;
        place += 1;
    }
    table
};

/// Sets the bit of a cell of the block, by the low nine bits of its key.
#[inline(always)]
pub(crate) fn set(leaf: &mut BlockMask, key: MortonKey) {
    let place = usize::from(PLACE_OF_MORTON[key.raw() as usize % BlockKey::BLOCK_CELLS]);
    leaf[place >> 6 & 7] |= 1 << (place & 63);
}

/// Tests whether the cell at `place` of the block is occupied.
#[inline(always)]
pub(crate) fn is_set(leaf: &BlockMask, place: usize) -> bool {
    leaf.get(place >> 6)
        .is_some_and(|word| word >> (place & 63) & 1 != 0)
}

/// Positions of the set bits.
#[inline]
pub(crate) fn places(leaf: &BlockMask) -> impl Iterator<Item = usize> + '_ {
    let words = leaf.iter().enumerate();
    words.flat_map(|(word, &left)| bits(left).map(move |bit| 64 * word + bit))
}

/// Indices of the set bits of a word, below 64.
#[inline(always)]
pub(crate) fn bits(mut left: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (left != 0).then(|| left.trailing_zeros() as usize & 63)?;
        left &= left - 1;
        Some(bit)
    })
}

/// All `len` cells of the blocks as ascending keys: blocks are sorted, not cells.
pub(crate) fn sorted_keys<'a>(
    blocks: impl Iterator<Item = (u64, &'a BlockMask)>,
    len: usize,
) -> Vec<MortonKey> {
    let first_key = |block: u64| BlockKey::from_raw(block << 9).and_then(BlockKey::key);
    let mut order: Vec<(u64, &BlockMask)> = blocks
        .filter_map(|(block, mask)| Some((first_key(block)?.raw(), mask)))
        .collect();
    order.par_sort_unstable_by_key(|&(key, _)| key);
    let mut keys = Vec::with_capacity(len);
    for (first, leaf) in order {
        let mut turned: BlockMask = [0; 8];
        for place in places(leaf) {
            let morton = usize::from(MORTON_OF_PLACE.get(place).copied().unwrap_or(0));
            if let Some(word) = turned.get_mut(morton >> 6) {
                *word |= 1 << (morton & 63);
            }
        }
        keys.extend(places(&turned).filter_map(|low| MortonKey::from_raw(first | low as u64)));
    }
    keys
}
