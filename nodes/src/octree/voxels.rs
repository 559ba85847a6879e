//! Voxels of an octree from the cells of a lattice.

use lattice_core::lattice::{Lattice, LatticeIndex};
use nalgebra::Vector3;
use rustc_hash::FxHashSet;

use super::encode::{BLOCK_LEVELS, BLOCK_VOXELS, EncodedTree, Encoder, LEVELS, OctreeForm};
use super::error::OctreeError;

/// Voxels on each side of the centre of a tree.
pub const HALF: i64 = 1 << (LEVELS - 1);

/// Voxels with half the cell size of a lattice, each with the value of the cell that its centre lies in.
///
/// A cubic cell is exactly eight voxels: an octree has corners where that lattice has centres, so voxels of the
/// full cell size would not align.
pub struct OctreeVoxels<'a> {
    lattice: &'a Lattice,
    datum_m: Vector3<f64>,
    resolution_m: f64,
    /// Half the extent of a cell on each axis.
    reach_m: Vector3<f64>,
    /// Codes of the blocks that may have known voxels.
    blocks: FxHashSet<u64>,
}

impl<'a> OctreeVoxels<'a> {
    /// Voxels for a lattice with the datum at its lattice point 0.
    pub fn new(lattice: &'a Lattice, datum_m: Vector3<f64>) -> Self {
        let vertices = &lattice.cell().vertices;
        let reach_m = vertices.iter().fold(Vector3::zeros(), |reach, vertex| {
            Vector3::sup(&reach, &vertex.abs())
        });
        Self {
            lattice,
            datum_m,
            resolution_m: lattice.cell_side_m() / 2.0,
            reach_m,
            blocks: FxHashSet::default(),
        }
    }

    /// Voxel edge, metres.
    pub fn resolution_m(&self) -> f64 {
        self.resolution_m
    }

    /// Adds a known cell.
    pub fn add(&mut self, cell: LatticeIndex) -> Result<(), OctreeError> {
        let center_m = self.datum_m + self.lattice.center(cell);
        let range = |axis: usize| {
            let (center, reach) = (center_m[axis], self.reach_m[axis]);
            // Voxels with their centre within the extent.
            let low = ((center - reach) / self.resolution_m - 0.5).ceil() as i64;
            let high = ((center + reach) / self.resolution_m - 0.5).floor() as i64;
            (low >> BLOCK_LEVELS, high >> BLOCK_LEVELS)
        };
        let ranges = [range(0), range(1), range(2)];
        let half = HALF >> BLOCK_LEVELS;
        if !ranges
            .iter()
            .all(|(low, high)| *low >= -half && *high < half)
        {
            return Err(OctreeError::Outside {
                center_m: center_m.into(),
                limit_m: HALF as f64 * self.resolution_m,
            });
        }
        let [xs, ys, zs] = ranges.map(|(low, high)| low..=high);
        for z in zs {
            for y in ys.clone() {
                for x in xs.clone() {
                    let block = [x, y, z].map(|i| (i + half) as u64);
                    self.blocks.insert(code(block));
                }
            }
        }
        Ok(())
    }

    /// Encodes the tree with at most `max_bytes`. `value` are the log-odds of a cell in steps of 1/32, or
    /// [`super::UNKNOWN`]; a voxel is occupied from `threshold` on.
    pub fn encode(
        self,
        form: OctreeForm,
        threshold: i8,
        max_bytes: usize,
        value: impl Fn(LatticeIndex) -> i8,
    ) -> Result<EncodedTree, OctreeError> {
        let mut blocks: Vec<u64> = self.blocks.into_iter().collect();
        blocks.sort_unstable();
        let half = HALF >> BLOCK_LEVELS;
        let places: Vec<[f64; 3]> = (0..BLOCK_VOXELS as u64)
            .map(|place| axes(place).map(|i| i as f64 + 0.5))
            .collect();
        let mut known = KnownCells::new();
        let fill = |block: u64, voxels: &mut [i8; BLOCK_VOXELS]| {
            let [x, y, z] = axes(block).map(|i| ((i as i64 - half) << BLOCK_LEVELS) as f64);
            let datum_m = self.datum_m;
            let middles_m = places.iter().map(|[a, b, c]| {
                let middle_m = Vector3::new(x + a, y + b, z + c) * self.resolution_m;
                (middle_m - datum_m).into()
            });
            let mut voxels = voxels.iter_mut();
            self.lattice.quantize_each(middles_m, |_, cell| {
                if let (Some(voxel), Some(cell)) = (voxels.next(), cell) {
                    *voxel = known.value(cell, &value);
                }
            });
        };
        Encoder::run(form, threshold, max_bytes, &blocks, fill)
    }
}

/// Values of the last cells: a cell has several voxels, and a search of the map takes longer than a comparison.
struct KnownCells(Vec<(LatticeIndex, i8)>);

impl KnownCells {
    /// Distinct cells on each axis: more than a block has.
    const SIDE: i32 = 8;

    fn new() -> Self {
        let none = ([i32::MIN; 3], super::UNKNOWN);
        Self(vec![none; Self::SIDE.pow(3) as usize])
    }

    fn value(&mut self, cell: LatticeIndex, value: impl Fn(LatticeIndex) -> i8) -> i8 {
        let [x, y, z] = cell.map(|i| i.rem_euclid(Self::SIDE) as usize);
        match self.0.get_mut(x + 8 * y + 64 * z) {
            Some((known, value)) if *known == cell => *value,
            Some(place) => {
                *place = (cell, value(cell));
                place.1
            }
            None => value(cell),
        }
    }
}

/// Interleaved bits of x, y and z for each level, x lowest.
fn code(place: [u64; 3]) -> u64 {
    (0..LEVELS).fold(0, |code, level| {
        let [x, y, z] = place.map(|v| v >> level & 1);
        code | (x | y << 1 | z << 2) << (3 * level)
    })
}

/// x, y and z of a code.
fn axes(code: u64) -> [u64; 3] {
    [0, 1, 2]
        .map(|axis| (0..LEVELS).fold(0, |v, level| v | (code >> (3 * level + axis) & 1) << level))
}
