//! Coordinate types of a batch: single or double precision.

use super::batch_quantizer::{BatchBlock, BatchQuantizer, BatchSums};
use super::kernel::{BLOCK, Lanes};
use crate::lattice::{BlockKey, nearest_integer};

/// Units of [`BatchBlock::fixed`] per metre.
const PER_METRE: f64 = (1_u64 << 20) as f64;
/// Coordinate (metres) below which doubles are integers of fewer than 2^51 units, which round exactly.
const REACH_M: f64 = (1_u64 << 31) as f64;

/// Coordinate of a point: `f32` uses the kernel, `f64` the closed form.
pub trait Coordinate: Copy + Into<f64> + Send + Sync + 'static {
    /// Visits the cells of up to [`BatchQuantizer::BLOCK`] points at a time, in order, with the quantization error of
    /// the points that have a cell.
    fn for_blocks_with_sums(
        quantizer: &BatchQuantizer,
        points: &[[Self; 3]],
        visit: impl FnMut(&BatchBlock),
    );

    /// Contribution of one point to the sums of the blocks.
    fn sums_of(quantizer: &BatchQuantizer, point: [Self; 3]) -> BatchSums;
}

impl Coordinate for f32 {
    #[inline]
    fn for_blocks_with_sums(
        quantizer: &BatchQuantizer,
        points: &[[f32; 3]],
        visit: impl FnMut(&BatchBlock),
    ) {
        quantizer.for_blocks_with_sums(points, visit);
    }

    fn sums_of(quantizer: &BatchQuantizer, point: [f32; 3]) -> BatchSums {
        quantizer.sums_of(point)
    }
}

/// Coordinates of 2^31 m and more have no cell.
impl Coordinate for f64 {
    fn for_blocks_with_sums(
        quantizer: &BatchQuantizer,
        points: &[[f64; 3]],
        mut visit: impl FnMut(&BatchBlock),
    ) {
        let mut lanes = Lanes::default();
        for block in points.chunks(BLOCK) {
            let mut sums = BatchSums::default();
            for (i, (&point, code)) in block.iter().zip(&mut lanes.codes).enumerate() {
                let (found, own) = decide(quantizer, point);
                *code = found;
                sums.add(&own);
                for (axis, metres) in lanes.fixed.iter_mut().zip(point) {
                    if let Some(fixed) = axis.get_mut(i) {
                        *fixed = nearest_integer(metres * PER_METRE) as i32;
                    }
                }
            }
            visit(&BatchBlock {
                codes: lanes.codes.get(..block.len()).unwrap_or_default(),
                sums: &sums,
                fixed: &lanes.fixed,
            });
        }
    }

    fn sums_of(quantizer: &BatchQuantizer, point: [f64; 3]) -> BatchSums {
        decide(quantizer, point).1
    }
}

fn decide(quantizer: &BatchQuantizer, point: [f64; 3]) -> (BlockKey, BatchSums) {
    match point.iter().all(|metres| metres.abs() < REACH_M) {
        true => quantizer.exactly(point),
        false => (BlockKey::NONE, BatchSums::default()),
    }
}
