//! Free space in a coarser lattice.

use std::collections::BTreeSet;

use nalgebra::Vector3;
use rustc_hash::FxHashSet;

use super::blocks::{Blocks, CELLS, add_evidence, apply_to_hit};
use super::evidence::Steps;
use super::masks::{Mask, ScanMasks};
use super::packed::{Packed, difference};
use crate::lattice::{Lattice, LatticeError, LatticeIndex, MortonKey};

/// Tolerance of the overlap of cells, relative to the cell size.
const SLACK: f64 = 1e-9;

/// Log-odds of cells `2^level` as wide as those of the map, with the same lattice point 0.
///
/// A lattice is its own sublattice of level 1, so the coarse cell of a fine index `8 b + r` is that of `r` plus
/// `8 b / 2^level`.
#[derive(Clone)]
pub(super) struct Coarse {
    lattice: Lattice,
    level: u32,
    /// Coarse cell that contains the lattice point, by position in a fine block.
    belongs: Vec<LatticeIndex>,
    /// Coarse cells that a cell may overlap, by position in a fine block.
    overlaps: Vec<Vec<LatticeIndex>>,
    masks: ScanMasks,
    cells: Blocks,
}

impl Coarse {
    pub(super) fn new(fine: &Lattice, level: u32, bytes: usize) -> Result<Coarse, LatticeError> {
        // A power of two, so that the generator is exactly 2^level times that of the fine lattice.
        let lattice = fine.scaled(f64::from(1 << level))?;
        let places = (0..CELLS as i32).map(|p| [p & 7, p >> 3 & 7, p >> 6]);
        let (mut belongs, mut overlaps) = (Vec::new(), Vec::new());
        for place in places {
            let p = fine.center(place);
            let home = lattice.quantize(&p).unwrap_or_default();
            belongs.push(home);
            let radius_m = fine.covering_radius_m();
            overlaps.push(overlapping(&lattice, home, &p, radius_m));
        }
        Ok(Coarse {
            lattice,
            level,
            belongs,
            overlaps,
            masks: ScanMasks::new(bytes / 4 / ScanMasks::BYTES_PER_BLOCK),
            cells: Blocks::new(bytes / 4 * 3 / Blocks::BYTES_PER_BLOCK),
        })
    }

    pub(super) fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    pub(super) fn bytes(&self) -> usize {
        self.masks.bytes() + self.cells.bytes()
    }

    /// Coarse index of the first cell of a fine block.
    fn base(&self, block: u64) -> LatticeIndex {
        Packed(block).unpack().map(|i| i >> self.level)
    }

    /// Coarse cells that a fine cell may overlap.
    fn overlapped(&self, fine: Packed) -> impl Iterator<Item = Packed> + '_ {
        let base = self.base(fine.block());
        let around = self.overlaps.get(fine.place()).into_iter().flatten();
        around.filter_map(move |w| Packed::new(offset(base, *w)))
    }

    /// Adds a scan, see [`super::FreeSpaceMap`]; returns the number of refused blocks.
    pub(super) fn apply(&mut self, steps: &Steps, scan: &ScanMasks, fine: &mut Blocks) -> u64 {
        self.mark(scan);
        let fine_refused = apply_to_hit(steps, scan, fine);
        let coarse_refused = self.cells.apply(
            self.masks.blocks(),
            |passed, hit| passed.without(hit) != Mask::default(),
            |cells, passed, hit| {
                add_evidence(steps, cells, &passed.without(hit), &Mask::default());
            },
        );
        fine_refused + coarse_refused
    }

    /// Marks coarse cells of traversed fine cells as traversed, and those overlapping hit cells as hit.
    fn mark(&mut self, scan: &ScanMasks) {
        self.masks.clear();
        let mut blocks: Vec<_> = scan.blocks().collect();
        blocks.sort_unstable_by_key(|(block, ..)| *block);
        for &(block, _, hit) in &blocks {
            let base = self.base(block);
            for w in (hit.places()).flat_map(|place| self.overlaps.get(place).into_iter().flatten())
            {
                if let Some(cell) = Packed::new(offset(base, *w)) {
                    self.masks.hit(cell);
                }
            }
        }
        for &(block, passed, _) in &blocks {
            let Some(base) = Packed::new(self.base(block)) else {
                continue;
            };
            for home in passed.places().filter_map(|place| self.belongs.get(place)) {
                self.masks.pass(base.plus(difference(*home)));
            }
        }
    }

    /// All free coarse cells in ascending order.
    pub(super) fn free_keys(&self, steps: &Steps, fine: &Blocks) -> Vec<MortonKey> {
        let occupied = fine.known().filter(|(_, value)| *value >= steps.threshold);
        let blocked: FxHashSet<Packed> = occupied.flat_map(|(w, _)| self.overlapped(w)).collect();
        let known = self.cells.known();
        let free = known.filter(|(w, value)| *value < steps.threshold && !blocked.contains(w));
        let mut keys: Vec<MortonKey> = free.filter_map(|(w, _)| w.key()).collect();
        keys.sort_unstable();
        keys
    }
}

fn offset(a: LatticeIndex, b: LatticeIndex) -> LatticeIndex {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// Superset of the cells that a ball overlaps, starting with the one that contains its centre.
///
/// A cell is excluded only if the ball is entirely on the other side of one of its faces.
fn overlapping(
    lattice: &Lattice,
    home: LatticeIndex,
    center_m: &Vector3<f64>,
    radius_m: f64,
) -> Vec<LatticeIndex> {
    let faces = lattice.face_neighbors();
    let may_overlap = |w: LatticeIndex| {
        let p = center_m - lattice.center(w);
        faces.iter().all(|n| {
            let n = lattice.center(*n);
            n.dot(&p) - 0.5 * n.norm_squared() <= (radius_m + SLACK * n.norm()) * n.norm()
        })
    };
    let mut found = BTreeSet::from([home]);
    let mut open = vec![home];
    // The cells that a ball overlaps are connected by faces.
    while let Some(w) = open.pop() {
        for n in faces {
            let next = offset(w, *n);
            if may_overlap(next) && found.insert(next) {
                open.push(next);
            }
        }
    }
    found.into_iter().collect()
}
