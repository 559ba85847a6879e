//! Batches of points in double precision.

use super::kernel::{BLOCK, Lanes};
use super::{BatchQuantizer, BlockKey};

impl BatchQuantizer {
    /// [`BatchQuantizer::codes`] of points in double precision, metres.
    ///
    /// The kernel sees them rounded and knows it: what the rounding leaves open is decided by the points
    /// as they are. Far from the origin of the points that is more of them.
    pub fn codes_wide(&self, points: &[[f64; 3]], codes: &mut Vec<BlockKey>) {
        codes.reserve(points.len());
        let mut lanes = Lanes::default();
        let mut block = [[f32::NAN; 3]; BLOCK];
        for points in points.chunks(BLOCK) {
            for (to, from) in block.iter_mut().zip(points) {
                *to = from.map(|x| x as f32);
            }
            let mut open = match &self.kernel {
                Some(kernel) => {
                    (kernel.run)(&kernel.rounded, &block, &mut lanes);
                    lanes.open()
                }
                None => {
                    lanes.decided.fill(0);
                    u32::MAX
                }
            };
            while open != 0 {
                let first = 8 * open.trailing_zeros() as usize;
                self.settle_wide(points, first, &mut lanes);
                open &= open - 1;
            }
            codes.extend(lanes.codes.iter().take(points.len()));
        }
    }

    /// Decides those of eight points that the kernel could not.
    #[cold]
    fn settle_wide(&self, points: &[[f64; 3]], first: usize, lanes: &mut Lanes) {
        let marks = lanes.codes.iter_mut().zip(&lanes.decided);
        let eight = points.iter().zip(marks).skip(first).take(8);
        for (p, (code, _)) in eight.filter(|(_, (_, decided))| **decided == 0) {
            let found = self.lattice.quantize(&self.transform_wide(*p));
            *code = found.and_then(BlockKey::pack).unwrap_or(BlockKey::NONE);
        }
    }
}
