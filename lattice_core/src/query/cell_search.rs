//! A* (Hart, Nilsson & Raphael 1968) over cells, or over every n-th of them, its state kept by block.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use rustc_hash::FxHashMap;

use super::bounds::Bounds;
use super::corridor::Corridor;
use super::free_places::{FreePlaces, local, set};
use super::path_error::PathError;
use super::shells::add;
use super::step_length::StepLength;
use crate::lattice::{BlockKey, LatticeIndex};
use crate::voxels::VoxelStore;
use crate::voxels::store::block_mask::{self, BlockMask};

/// Units of length in a cell side. Whole units let permutations of the same steps compare as equally long.
const UNITS: f64 = (1_u64 << 32) as f64;
/// Total lengths that differ by less than 2^8 units count as equal: the bound to the goal is rounded by some 2^2 units
/// at 10^6 cells (f64), and the differences may be on either side of a limit.
const EQUAL_BITS: u32 = 8;
/// Memory of a search, bytes. Some 40 million cells fill it, or long steps through 10^4 blocks of 8 x 8 x 8 places.
const MAX_BYTES: usize = 1 << 29;
/// Step of a cell that no step reached.
const NO_STEP: u8 = u8::MAX;
const UNKNOWN: u32 = u32::MAX;

/// Place of a search: its block in order of discovery, and its number there.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Node(u32);

impl Node {
    fn new(slot: u32, place: usize) -> Node {
        Node(slot << 9 | place as u32)
    }

    fn slot(self) -> u32 {
        self.0 >> 9
    }

    fn place(self) -> usize {
        self.0 as usize & 511
    }
}

/// State of one search.
pub(super) struct CellSearch<'a, S> {
    store: &'a S,
    corridor: &'a Corridor,
    /// In the frame of the datum.
    bounds: Option<Bounds>,
    /// Cell of place 0.
    origin: LatticeIndex,
    /// Weight of the bound to the goal: ways are at most as much longer than the shortest.
    weight: f64,
    /// Lengths of the steps, units.
    steps: Vec<(LatticeIndex, u64)>,
    bound: StepLength,
    unit_m: f64,
    slots: FxHashMap<u64, u32>,
    blocks: Vec<Box<Block>>,
    /// Memory of the blocks, bytes.
    bytes: usize,
    max_expanded: usize,
}

struct Block {
    /// First place, in strides from the origin.
    first: LatticeIndex,
    free: FreePlaces,
    expanded: BlockMask,
    /// Length of the shortest known way to each cell, units.
    lengths: [u64; BlockKey::BLOCK_CELLS],
    /// Last step of that way.
    last: [u8; BlockKey::BLOCK_CELLS],
    /// Slots of the blocks around, by `(x + 1) * 9 + (y + 1) * 3 + z + 1`.
    around: [u32; 27],
}

impl<'a, S: VoxelStore> CellSearch<'a, S> {
    /// Creates a search; `bounds` are in the frame of the datum.
    pub(super) fn new(
        store: &'a S,
        corridor: &'a Corridor,
        bounds: Option<Bounds>,
        max_expanded: usize,
    ) -> CellSearch<'a, S> {
        let unit_m = store.lattice().cell_side_m() / UNITS;
        let steps = corridor.steps.iter();
        CellSearch {
            store,
            corridor,
            bounds,
            steps: steps
                .map(|&(by, length_m)| (by, (length_m / unit_m).round() as u64))
                .collect(),
            origin: [0; 3],
            weight: 1.0,
            bound: corridor.bound(store.lattice()),
            unit_m,
            slots: FxHashMap::default(),
            blocks: Vec::new(),
            bytes: 0,
            max_expanded,
        }
    }

    /// Counts places from a cell, and lets ways be longer than the shortest by a factor.
    pub(super) fn relaxed(self, origin: LatticeIndex, weight: f64) -> CellSearch<'a, S> {
        CellSearch {
            origin,
            weight,
            ..self
        }
    }

    /// Places near a cell, nearest first; the cell itself if it is a place.
    pub(super) fn places_near(&self, w: LatticeIndex) -> Vec<LatticeIndex> {
        let stride = self.corridor.stride;
        let by = [0, 1, 2].map(|axis| w[axis] - self.origin[axis]);
        let low = by.map(|i| i.div_euclid(stride));
        if stride == 1 {
            return vec![low];
        }
        let lattice = self.store.lattice();
        let center_m = lattice.center(w);
        let corners =
            (0..64).map(|code| add(low, [code & 3, code >> 2 & 3, code >> 4].map(|i| i - 1)));
        let mut near: Vec<_> = corners
            .map(|place| ((lattice.center(self.cell(place)) - center_m).norm(), place))
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        near.into_iter().map(|(_, place)| place).collect()
    }

    /// Node of a place; `None` if the ball does not fit there.
    pub(super) fn open_node(&mut self, w: LatticeIndex) -> Option<Node> {
        let slot = self.slot_of(w)?;
        let place = BlockKey::pack(w)?.place();
        self.open(slot, place)
    }

    /// Finds the shortest way; returns the number of expanded cells.
    pub(super) fn run(
        &mut self,
        start: Node,
        goal: Node,
        mut go_on: impl FnMut() -> bool,
    ) -> Result<usize, PathError> {
        let goal_place = self.place(goal);
        let scale = self.weight * f64::from(self.corridor.stride) / self.unit_m;
        let to_goal =
            |search: &Self, w: LatticeIndex| (search.bound.between_m(w, goal_place) * scale) as u64;
        let least = to_goal(self, self.place(start));
        let total = |length: u64, rest: u64| {
            (length + rest + (1 << (EQUAL_BITS - 1))).saturating_sub(least) >> EQUAL_BITS
        };
        // Of equally long ways the one nearest to the goal is continued.
        let mut waiting = BinaryHeap::from([Reverse((0, least, start))]);
        self.reach(start, 0, NO_STEP);
        let mut expanded = 0;
        while let Some(Reverse((_, _, at))) = waiting.pop() {
            if at == goal {
                return Ok(expanded);
            }
            let Some((length, wide)) = self.expand(at) else {
                continue;
            };
            if expanded == self.max_expanded || !go_on() {
                return Err(PathError::Limit { expanded });
            }
            expanded += 1;
            let from = local(at.place());
            for number in 0..self.steps.len() {
                let Some(&(by, step)) = self.steps.get(number) else {
                    break;
                };
                let Some(to) = self.neighbor(at.slot(), add(from, by)) else {
                    if self.is_full() {
                        return Err(PathError::Limit { expanded });
                    }
                    continue;
                };
                let length = length + step;
                if self.is_better(to, length) && (wide || self.is_step_free(at, number)) {
                    self.reach(to, length, number as u8);
                    let rest = to_goal(self, self.place(to));
                    waiting.push(Reverse((total(length, rest), rest, to)));
                }
            }
        }
        Err(PathError::NoPath { expanded })
    }

    /// Cells of the shortest known way to a node, from its start.
    pub(super) fn way_to(&self, goal: Node) -> Vec<LatticeIndex> {
        let mut at = self.place(goal);
        let mut cells = vec![self.cell(at)];
        while let Some(by) = self.last_step(at) {
            at = [0, 1, 2].map(|axis| at[axis] - by[axis]);
            cells.push(self.cell(at));
        }
        cells.reverse();
        cells
    }

    fn last_step(&self, w: LatticeIndex) -> Option<LatticeIndex> {
        let key = BlockKey::pack(w)?;
        let block = self.block(*self.slots.get(&key.block())?)?;
        let number = block.last.get(key.place())?;
        self.steps.get(usize::from(*number)).map(|step| step.0)
    }

    /// Marks a node as expanded; returns its length and whether no step from it is blocked, if it was not.
    fn expand(&mut self, at: Node) -> Option<(u64, bool)> {
        let place = at.place();
        let block = self.blocks.get_mut(at.slot() as usize)?;
        if block_mask::is_set(&block.expanded, place) {
            return None;
        }
        set(&mut block.expanded, place, true);
        let length = *block.lengths.get(place)?;
        Some((length, block.free.is_wide(self.corridor, place)))
    }

    fn is_step_free(&mut self, at: Node, number: usize) -> bool {
        let block = self.blocks.get_mut(at.slot() as usize);
        block.is_some_and(|block| {
            let free = &mut block.free;
            free.is_step_free(self.corridor, at.place(), number)
        })
    }

    /// Tests whether a way to an open node is shorter than the known one. With a weight above 1 expanded nodes stay as
    /// they are: the bound on the length holds (Likhachev, Gordon & Thrun 2003).
    fn is_better(&self, to: Node, length: u64) -> bool {
        self.block(to.slot()).is_some_and(|block| {
            let known = block.lengths.get(to.place());
            let settled = self.weight > 1.0 && block_mask::is_set(&block.expanded, to.place());
            known.is_some_and(|known| length < *known) && !settled
        })
    }

    /// Notes a way to an open node.
    fn reach(&mut self, to: Node, length: u64, step: u8) {
        let Some(block) = self.blocks.get_mut(to.slot() as usize) else {
            return;
        };
        let place = to.place();
        if let (Some(known), Some(last)) = (block.lengths.get_mut(place), block.last.get_mut(place))
        {
            (*known, *last) = (length, step);
        }
        set(&mut block.expanded, place, false);
    }

    /// Node at a position relative to a block, if the ball fits there.
    fn neighbor(&mut self, slot: u32, local: LatticeIndex) -> Option<Node> {
        let by = local.map(|i| i >> 3);
        let place = local
            .iter()
            .fold(0, |place, i| place << 3 | (i & 7) as usize);
        let to = if by == [0; 3] {
            slot
        } else {
            self.block_at(slot, by)?
        };
        self.open(to, place)
    }

    fn open(&mut self, slot: u32, place: usize) -> Option<Node> {
        let block = self.blocks.get_mut(slot as usize)?;
        let open = block.free.is_open(self.corridor, place);
        open.then(|| Node::new(slot, place))
    }

    /// Slot of a block by its difference from another.
    fn block_at(&mut self, slot: u32, by: LatticeIndex) -> Option<u32> {
        let block = self.block(slot)?;
        let near = by.iter().all(|i| (-1..=1).contains(i));
        let number = by.iter().fold(0, |number, i| 3 * number + i + 1) as usize;
        match block.around.get(number) {
            Some(&known) if near && known != UNKNOWN => return Some(known),
            _ => {}
        }
        let found = self.slot_of(add(block.first, by.map(|i| 8 * i)))?;
        if near
            && let Some(block) = self.blocks.get_mut(slot as usize)
            && let Some(known) = block.around.get_mut(number)
        {
            *known = found;
        }
        Some(found)
    }

    /// Slot of the block of a place; `None` out of the range of keys, and for a new block of a full search.
    fn slot_of(&mut self, w: LatticeIndex) -> Option<u32> {
        let key = BlockKey::pack(w)?;
        if let Some(&slot) = self.slots.get(&key.block()) {
            return Some(slot);
        }
        if self.is_full() {
            return None;
        }
        let first = w.map(|i| i & !7);
        // All places are cells in range.
        for corner in [first, first.map(|i| i + 7)] {
            BlockKey::pack(self.cell(corner))?;
        }
        let mut free = FreePlaces::new(self.corridor, self.store, self.cell(first));
        if let Some(bounds) = &self.bounds {
            let center_m = |by| self.store.lattice().center(self.cell(add(first, by)));
            free.limit(|by| bounds.contains(&center_m(by)));
        }
        let slot = self.blocks.len() as u32;
        self.bytes += size_of::<Block>() + free.bytes();
        self.slots.insert(key.block(), slot);
        self.blocks.push(Box::new(Block {
            first,
            free,
            expanded: [0; 8],
            lengths: [u64::MAX; BlockKey::BLOCK_CELLS],
            last: [NO_STEP; BlockKey::BLOCK_CELLS],
            around: [UNKNOWN; 27],
        }));
        Some(slot)
    }

    fn is_full(&self) -> bool {
        self.bytes >= MAX_BYTES
    }

    fn block(&self, slot: u32) -> Option<&Block> {
        self.blocks.get(slot as usize).map(|block| &**block)
    }

    /// Cell of a place.
    pub(super) fn cell(&self, place: LatticeIndex) -> LatticeIndex {
        cell(self.origin, self.corridor.stride, place)
    }

    fn place(&self, node: Node) -> LatticeIndex {
        let by = local(node.place());
        let block = self.block(node.slot());
        block.map_or(by, |block| add(block.first, by))
    }
}

fn cell(origin: LatticeIndex, stride: i32, place: LatticeIndex) -> LatticeIndex {
    [0, 1, 2].map(|axis| origin[axis] + stride * place[axis])
}
