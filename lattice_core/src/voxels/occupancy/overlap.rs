//! Number of points in occupied cells.

use nalgebra::{Isometry3, Translation3};

use super::OccupancyList;
use crate::lattice::BatchQuantizer;
use crate::voxels::store::block_mask::{self, BlockMask};

impl OccupancyList {
    /// Number of points (metres) that `map_from_points` transforms into occupied cells; fastest for spatially sorted
    /// points.
    pub fn overlap(&self, map_from_points: &Isometry3<f64>, points_m: &[[f32; 3]]) -> usize {
        const NOTHING: &BlockMask = &[0; 8];
        let datum_from_points = Translation3::from(-self.datum_m) * map_from_points;
        let quantizer = BatchQuantizer::new(&self.lattice, datum_from_points);
        let (mut block, mut leaf) = (u64::MAX, NOTHING);
        let mut hits = 0;
        quantizer.for_blocks(points_m, |codes, _| {
            for code in codes {
                if code.block() != block {
                    block = code.block();
                    // The block of a point without a cell is in no list.
                    let number = self.blocks.find(block);
                    let row = number.and_then(|number| self.blocks.rows().get(number as usize));
                    leaf = row.map_or(NOTHING, |row| &row.leaf);
                }
                hits += usize::from(block_mask::is_set(leaf, code.place()));
            }
        });
        hits
    }
}
