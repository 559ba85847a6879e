//! Accumulation of points by cell before they reach the table.

use super::fixed_point::Point;
use crate::lattice::{BatchQuantizer, BlockKey};

const BLOCK: usize = BatchQuantizer::BLOCK;
const SLOTS_LOG2: u32 = 13;
const SLOTS: usize = 1 << SLOTS_LOG2;

/// Points of one cell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Partial {
    pub(crate) code: BlockKey,
    pub(crate) points: Point,
}

const EMPTY: Partial = Partial {
    code: BlockKey::NONE,
    points: Point::ZERO,
};

/// Fraction n / d of cell changes between consecutive points above which branching on them is slower.
const SCATTERED: (usize, usize) = (1, 5);

/// Cells being filled, in a direct-mapped table of the size of the cache.
///
/// Adjacent beams and successive scans fill the same cells. Most points end here, and the large table is accessed
/// once per cell for many points.
#[derive(Clone, Debug)]
pub(crate) struct Gather {
    slots: Vec<Partial>,
    /// Cells that a block of points evicted from their slots.
    moved: Vec<Partial>,
    scattered: bool,
}

impl Gather {
    pub(crate) fn new() -> Gather {
        Gather {
            slots: vec![EMPTY; SLOTS],
            moved: vec![EMPTY; 2 * BLOCK],
            scattered: false,
        }
    }

    /// Adds the points of a block in order, each as the `point` of its index.
    ///
    /// Returns the cells that were evicted or have `most_points`. They may include [`BlockKey::NONE`].
    #[inline(always)]
    pub(crate) fn add(
        &mut self,
        codes: &[BlockKey],
        point: impl Fn(usize) -> Point,
        most_points: u32,
    ) -> &[Partial] {
        let moved = if self.scattered {
            self.add_to_slots::<false>(codes, point, most_points)
        } else {
            self.add_to_slots::<true>(codes, point, most_points)
        };
        self.scattered = moved * SCATTERED.1 > codes.len() * SCATTERED.0;
        self.moved.get(..moved).unwrap_or_default()
    }

    /// Adds with or without a branch on whether a point is in the cell of its slot.
    #[inline(always)]
    fn add_to_slots<const BRANCH: bool>(
        &mut self,
        codes: &[BlockKey],
        point: impl Fn(usize) -> Point,
        most_points: u32,
    ) -> usize {
        let slots = self.slots.first_chunk_mut::<SLOTS>();
        let to = self.moved.first_chunk_mut::<{ 2 * BLOCK }>();
        let (Some(slots), Some(to)) = (slots, to) else {
            return 0;
        };
        let mut moved = 0;
        for (i, &code) in codes.iter().take(BLOCK).enumerate() {
            let hash = code.raw().wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let slot = &mut slots[(hash >> (64 - SLOTS_LOG2)) as usize];
            let stays = slot.code == code;
            if BRANCH {
                if !stays {
                    to[moved % (2 * BLOCK)] = *slot;
                    moved += 1;
                    *slot = EMPTY;
                }
                slot.points += point(i);
            } else {
                to[moved % (2 * BLOCK)] = *slot;
                moved += usize::from(!stays);
                let mask = Point::splat(u32::from(stays).wrapping_neg());
                slot.points = (slot.points & mask) + point(i);
            }
            slot.code = code;
            if slot.points.as_array()[3] >= most_points {
                to[moved % (2 * BLOCK)] = *slot;
                moved += 1;
                *slot = EMPTY;
            }
        }
        moved
    }

    /// Takes all cells.
    pub(crate) fn drain(&mut self) -> impl Iterator<Item = Partial> {
        let slots = self.slots.iter_mut();
        let partials = slots.map(|slot| std::mem::replace(slot, EMPTY));
        partials.filter(|partial| partial.code != BlockKey::NONE)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn every_point_leaves_once(
            seed in any::<u32>(),
            blocks in prop::collection::vec((1..=BLOCK, 1..60_000_u32), 1..30),
            most_points in 1..40_u32,
        ) {
            let mut gather = Gather::new();
            let (mut given, mut got) = (HashMap::new(), HashMap::new());
            let mut count = |partial: Partial| {
                assert!(partial.points.as_array()[3] <= most_points);
                *got.entry(partial.code).or_insert(Point::ZERO) += partial.points;
            };
            let mut random = seed;
            for (points, cells) in blocks {
                let codes: Vec<BlockKey> = (0..points)
                    .map(|_| {
                        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                        let cell = (random >> 8) % cells;
                        BlockKey::pack([cell as i32, 0, 0]).filter(|_| cell != 7).unwrap_or(BlockKey::NONE)
                    })
                    .collect();
                let point = |i: usize| Point::new([i as u32, 3, u32::MAX - 5, 1]);
                for (i, &code) in codes.iter().enumerate() {
                    *given.entry(code).or_insert(Point::ZERO) += point(i);
                }
                gather.add(&codes, point, most_points).iter().copied().for_each(&mut count);
            }
            gather.drain().for_each(&mut count);
            prop_assert!(gather.drain().next().is_none());
            for totals in [&mut given, &mut got] {
                totals.remove(&BlockKey::NONE);
            }
            prop_assert_eq!(given, got);
        }
    }
}
