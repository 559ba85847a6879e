//! Places of one block at which a ball fits, tested when they are asked for.

use super::corridor::Corridor;
use super::stencil::{Around, Stencil};
use crate::lattice::LatticeIndex;
use crate::voxels::VoxelStore;
use crate::voxels::store::block_mask::{self, BlockMask};

/// All places of a block.
const ALL: BlockMask = [u64::MAX; 8];

/// Free places and steps of a block. With cell by cell steps all places are tested at once, else each by itself.
pub(super) struct FreePlaces {
    /// Occupied cells about the block; `None` if there are none.
    around: Option<Around>,
    /// Places at which the ball fits, and those of which this is known.
    open: BlockMask,
    known: BlockMask,
    /// Places from which no step is blocked, and places from which each step is free; empty until they are asked for.
    wide: BlockMask,
    ways: Vec<BlockMask>,
}

impl FreePlaces {
    /// Tests of the block whose first place is cell `first`.
    pub(super) fn new(
        corridor: &Corridor,
        store: &impl VoxelStore,
        first: LatticeIndex,
    ) -> FreePlaces {
        let around = corridor.around(store, first);
        let mut places = FreePlaces {
            around: None,
            open: ALL,
            known: ALL,
            wide: ALL,
            ways: Vec::new(),
        };
        if around.is_empty() {
            return places;
        }
        if corridor.stride == 1 {
            places.open = free(&corridor.ball, &around);
            places.wide = free(&corridor.all, &around);
        } else {
            places.known = [0; 8];
        }
        places.around = Some(around);
        places
    }

    /// Excludes the places for which `inside` is false.
    pub(super) fn limit(&mut self, inside: impl Fn(LatticeIndex) -> bool) {
        for place in block_mask::places(&ALL) {
            if !inside(local(place)) {
                set(&mut self.known, place, true);
                set(&mut self.open, place, false);
            }
        }
    }

    /// Tests whether the ball fits at a place.
    pub(super) fn is_open(&mut self, corridor: &Corridor, place: usize) -> bool {
        if !block_mask::is_set(&self.known, place) {
            let met = self.meets(&corridor.ball, corridor, place);
            set(&mut self.known, place, true);
            set(&mut self.open, place, !met);
        }
        block_mask::is_set(&self.open, place)
    }

    /// Tests whether no step from a place is blocked.
    pub(super) fn is_wide(&self, corridor: &Corridor, place: usize) -> bool {
        match corridor.stride {
            _ if self.around.is_none() => true,
            1 => block_mask::is_set(&self.wide, place),
            _ => !self.meets(&corridor.all, corridor, place),
        }
    }

    /// Tests whether the ball fits on a step from a place, by the number of the step.
    pub(super) fn is_step_free(&mut self, corridor: &Corridor, place: usize, step: usize) -> bool {
        let Some(around) = &self.around else {
            return true;
        };
        if corridor.stride > 1 {
            let way = corridor.ways.get(step);
            return way.is_some_and(|way| !self.meets(way, corridor, place));
        }
        if self.ways.is_empty() {
            self.ways = corridor.ways.iter().map(|way| free(way, around)).collect();
        }
        let way = self.ways.get(step);
        way.is_some_and(|way| block_mask::is_set(way, place))
    }

    /// Memory of the tests, bytes.
    pub(super) fn bytes(&self) -> usize {
        self.around.as_ref().map_or(0, Around::bytes)
    }

    fn meets(&self, set: &Stencil, corridor: &Corridor, place: usize) -> bool {
        let by = local(place).map(|i| corridor.stride * i);
        let around = self.around.as_ref();
        around.is_some_and(|around| set.meets_at(by, around))
    }
}

/// Position of a place in its block, in strides.
pub(super) fn local(place: usize) -> LatticeIndex {
    [place >> 6, place >> 3 & 7, place & 7].map(|i| i as i32)
}

pub(super) fn set(mask: &mut BlockMask, place: usize, value: bool) {
    if let Some(word) = mask.get_mut(place >> 6) {
        let bit = 1 << (place & 63);
        *word = if value { *word | bit } else { *word & !bit };
    }
}

fn free(set: &Stencil, around: &Around) -> BlockMask {
    set.meets(around).map(|met| !met)
}
