//! Sets of cells that are moved over blocks of occupied cells.

use std::collections::BTreeMap;

use super::shells::add;
use crate::lattice::{BlockKey, LatticeIndex};
use crate::voxels::store::block_mask::BlockMask;

/// Cells of a block along each of its axes.
const SIDE: i32 = 8;
/// Lowest bit of each row of a word; a row holds the cells that differ in their third index.
const ROWS: u64 = 0x0101_0101_0101_0101;

/// Convex set of index differences.
pub(super) struct Stencil {
    columns: Vec<Column>,
}

/// Differences that agree in the first two indices.
#[derive(Clone, Copy)]
struct Column {
    x: i32,
    y: i32,
    low: i32,
    high: i32,
}

impl Stencil {
    /// Creates the smallest set that holds the cells and is connected along the third index.
    pub(super) fn new(cells: impl IntoIterator<Item = LatticeIndex>) -> Stencil {
        let mut columns = BTreeMap::new();
        for [x, y, z] in cells {
            let (low, high) = columns.entry((x, y)).or_insert((z, z));
            (*low, *high) = (z.min(*low), z.max(*high));
        }
        let column = |((x, y), (low, high))| Column { x, y, low, high };
        Stencil {
            columns: columns.into_iter().map(column).collect(),
        }
    }

    /// Lowest and highest difference of the blocks that the set reaches from a block.
    pub(super) fn blocks(&self) -> [LatticeIndex; 2] {
        let low = |low: i32| low.div_euclid(SIDE);
        let high = |high: i32| (high + SIDE - 1).div_euclid(SIDE);
        let mut reach = [[0; 3]; 2];
        for column in &self.columns {
            let lows = [column.x, column.y, column.low].map(low);
            let highs = [column.x, column.y, column.high].map(high);
            for axis in 0..3 {
                reach[0][axis] = reach[0][axis].min(lows[axis]);
                reach[1][axis] = reach[1][axis].max(highs[axis]);
            }
        }
        reach
    }

    /// Cells of a block from which the set meets an occupied cell.
    pub(super) fn meets(&self, around: &Around) -> BlockMask {
        let mut met = [0; 8];
        if around.is_empty() {
            return met;
        }
        for (x, word) in (0..SIDE).zip(&mut met) {
            for column in &self.columns {
                if *word == u64::MAX {
                    break;
                }
                for block in column.low.div_euclid(SIDE)..=(column.high + SIDE - 1).div_euclid(SIDE)
                {
                    let rows = around.rows(x + column.x, column.y, block);
                    if rows != 0 {
                        let low = (column.low - SIDE * block).max(1 - SIDE);
                        let high = (column.high - SIDE * block).min(SIDE - 1);
                        *word |= meets_run(rows, low, high);
                    }
                }
            }
        }
        met
    }

    /// Tests whether the set at a cell, by its difference from the cell of `around`, meets an occupied cell.
    pub(super) fn meets_at(&self, by: LatticeIndex, around: &Around) -> bool {
        let at = add(by, around.place);
        self.columns.iter().any(|column| {
            let (low, high) = (at[2] + column.low, at[2] + column.high);
            (low.div_euclid(SIDE)..=high.div_euclid(SIDE)).any(|block| {
                let row = around.row(at[0] + column.x, at[1] + column.y, block);
                let low = (low - SIDE * block).max(0);
                let high = (high - SIDE * block).min(SIDE - 1);
                row & (0xff >> (SIDE - 1 - high)) & (0xff << low) != 0
            })
        })
    }
}

/// Occupied cells of the block of a cell and of those around it.
pub(super) struct Around {
    /// Position of the cell in its block.
    place: LatticeIndex,
    low: LatticeIndex,
    sides: LatticeIndex,
    /// Number of each block's mask; 0 for blocks without occupied cells.
    numbers: Vec<u32>,
    masks: Vec<BlockMask>,
}

impl Around {
    /// Collects the blocks between two differences from the block of a cell; `occupied` gives the cells of a block by
    /// its number.
    pub(super) fn new(
        at: LatticeIndex,
        [low, high]: [LatticeIndex; 2],
        occupied: impl Fn(u64) -> BlockMask,
    ) -> Around {
        let (mut numbers, mut masks) = (Vec::new(), Vec::new());
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    let w = [at[0] + SIDE * x, at[1] + SIDE * y, at[2] + SIDE * z];
                    let block = BlockKey::pack(w).map(BlockKey::block);
                    let mask = block.map_or([0; 8], &occupied);
                    if mask != [0; 8] {
                        masks.push(mask);
                    }
                    numbers.push(if mask == [0; 8] {
                        0
                    } else {
                        masks.len() as u32
                    });
                }
            }
        }
        Around {
            place: at.map(|i| i & (SIDE - 1)),
            low,
            sides: [0, 1, 2].map(|axis| high[axis] - low[axis] + 1),
            numbers,
            masks,
        }
    }

    /// Tests whether no cell is occupied.
    pub(super) fn is_empty(&self) -> bool {
        self.masks.is_empty()
    }

    /// Memory of the cells, bytes.
    pub(super) fn bytes(&self) -> usize {
        size_of::<u32>() * self.numbers.capacity() + size_of::<BlockMask>() * self.masks.capacity()
    }

    fn word(&self, x: i32, y: i32, z: i32, word: i32) -> u64 {
        let at = [x - self.low[0], y - self.low[1], z - self.low[2]];
        if (0..3).any(|axis| !(0..self.sides[axis]).contains(&at[axis])) {
            return 0;
        }
        let block = (at[0] * self.sides[1] + at[1]) * self.sides[2] + at[2];
        let number = self.numbers.get(block as usize).copied().unwrap_or(0);
        let mask = (number as usize)
            .checked_sub(1)
            .and_then(|i| self.masks.get(i));
        mask.and_then(|mask| mask.get(word as usize))
            .copied()
            .unwrap_or(0)
    }

    /// Row of the first two indices in the blocks `z` along the third.
    fn row(&self, x: i32, y: i32, z: i32) -> u64 {
        let (block, word) = (x.div_euclid(SIDE), x.rem_euclid(SIDE));
        let rows = self.word(block, y.div_euclid(SIDE), z, word);
        rows >> (SIDE * y.rem_euclid(SIDE)) & 0xff
    }

    /// Rows of the first index `x`, the second from `y` to `y + 7`, in the blocks `z` along the third.
    fn rows(&self, x: i32, y: i32, z: i32) -> u64 {
        let (block, word) = (x.div_euclid(SIDE), x.rem_euclid(SIDE));
        let (first, row) = (y.div_euclid(SIDE), y.rem_euclid(SIDE));
        let low = self.word(block, first, z, word) >> (SIDE * row);
        if row == 0 {
            return low;
        }
        low | self.word(block, first + 1, z, word) << (SIDE * (SIDE - row))
    }
}

/// Cells of each row with an occupied cell `low` to `high` places further on, both between -7 and 7.
fn meets_run(rows: u64, low: i32, high: i32) -> u64 {
    if low > 0 {
        return spread_down(down(rows, low), high - low);
    }
    if high < 0 {
        return spread_up(up(rows, -high), high - low);
    }
    spread_down(rows, high) | spread_up(rows, -low)
}

/// Moves each row by `by` places down, from 0 to 7.
fn down(rows: u64, by: i32) -> u64 {
    rows >> by & (ROWS * (0xff >> by))
}

/// Moves each row by `by` places up, from 0 to 7.
fn up(rows: u64, by: i32) -> u64 {
    (rows & (ROWS * (0xff >> by))) << by
}

/// Unites the rows moved by 0 to `most` places down.
fn spread_down(mut rows: u64, most: i32) -> u64 {
    let mut covered = 0;
    while covered < most {
        let by = (covered + 1).min(most - covered);
        rows |= down(rows, by);
        covered += by;
    }
    rows
}

/// Unites the rows moved by 0 to `most` places up.
fn spread_up(mut rows: u64, most: i32) -> u64 {
    let mut covered = 0;
    while covered < most {
        let by = (covered + 1).min(most - covered);
        rows |= up(rows, by);
        covered += by;
    }
    rows
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn cells_meet_the_set_as_each_of_its_cells_tells(
            occupied in prop::collection::hash_set(prop::array::uniform3(-20..28_i32), 0..40),
            middle in prop::array::uniform3(-9..9_i32),
            radius in 0..7_i32,
        ) {
            let mut set = Vec::new();
            for x in -radius..=radius {
                for y in -radius..=radius {
                    for z in -radius..=radius {
                        if x * x + y * y + z * z <= radius * radius {
                            set.push([x + middle[0], y + middle[1], z + middle[2]]);
                        }
                    }
                }
            }
            let stencil = Stencil::new(set.iter().copied());
            let mask = |block: u64| {
                let mut mask = [0; 8];
                for key in occupied.iter().filter_map(|w| BlockKey::pack(*w)) {
                    if key.block() == block {
                        mask[key.place() >> 6] |= 1 << (key.place() & 63);
                    }
                }
                mask
            };
            let around = Around::new([0; 3], stencil.blocks(), mask);
            let met = stencil.meets(&around);
            for place in 0..BlockKey::BLOCK_CELLS {
                let w = [place >> 6, place >> 3 & 7, place & 7].map(|i| i as i32);
                let expected = set.iter().any(|by| {
                    occupied.contains(&[w[0] + by[0], w[1] + by[1], w[2] + by[2]])
                });
                prop_assert_eq!(met[place >> 6] >> (place & 63) & 1 != 0, expected, "{:?}", w);
                prop_assert_eq!(stencil.meets_at(w, &around), expected, "{:?}", w);
            }
        }
    }
}
