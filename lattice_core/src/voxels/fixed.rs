//! Positions in fixed point.

use super::shard::Point;
use super::{OFFSET_UNIT_M, Voxel};
use crate::lattice::{BatchBlock, BatchQuantizer, CellCode, Lattice, nearest_integer};

const PER_METRE: f64 = 1.0 / OFFSET_UNIT_M;

/// A position (metres) in `OFFSET_UNIT_M`.
#[inline(always)]
pub(super) fn fixed(metres: [f64; 3]) -> [i64; 3] {
    metres.map(|m| nearest_integer(m * PER_METRE))
}

/// The points of a block in fixed point from the datum.
///
/// The base is rounded, then the offset, so that neither the other points of a cloud nor the way it
/// is cut into blocks matters.
#[derive(Clone, Copy)]
pub(super) struct FixedBlock<'a> {
    base: [i64; 3],
    offsets_m: &'a [[f32; 3]],
    near: Option<&'a [[i32; BatchQuantizer::BLOCK]; 3]>,
}

impl FixedBlock<'_> {
    /// Points at `base_m + offset`.
    pub(super) fn new<'a>(
        base_m: [f64; 3],
        offsets_m: &'a [[f32; 3]],
        block: &BatchBlock<'a>,
    ) -> FixedBlock<'a> {
        FixedBlock {
            base: fixed(base_m),
            offsets_m,
            near: (!block.sums.far).then_some(block.fixed),
        }
    }

    /// The coordinates from the base, unless some point is far.
    #[inline(always)]
    pub(super) fn near(&self) -> Option<(&[[i32; BatchQuantizer::BLOCK]; 3], [i64; 3])> {
        Some((self.near?, self.base))
    }

    /// Point number `i`.
    #[inline(always)]
    pub(super) fn point(&self, i: usize) -> Point {
        match self.near {
            Some(near) => near_point(near, self.base, i),
            None => from_base(self.base, self.far(i)),
        }
    }

    #[cold]
    fn far(&self, i: usize) -> [i64; 3] {
        let offset = self.offsets_m.get(i).copied().unwrap_or_default();
        fixed(offset.map(f64::from))
    }
}

/// Point number `i` of those whose coordinates from the base fit 32 bits.
#[inline(always)]
pub(super) fn near_point(
    [x, y, z]: &[[i32; BatchQuantizer::BLOCK]; 3],
    base: [i64; 3],
    i: usize,
) -> Point {
    let i = i % BatchQuantizer::BLOCK;
    from_base(base, [x[i], y[i], z[i]].map(i64::from))
}

#[inline(always)]
fn from_base(base: [i64; 3], offset: [i64; 3]) -> Point {
    let sum = |axis: usize| base[axis].wrapping_add(offset[axis]);
    [sum(0), sum(1), sum(2), 1]
}

/// The centre of a cell in fixed point, from the datum.
#[inline]
pub(super) fn fixed_center(lattice: &Lattice, code: CellCode) -> [i64; 3] {
    fixed(lattice.center(code.unpack()).into())
}

/// The points of a voxel as offsets from the centre of its cell.
#[inline]
pub(super) fn voxel_of(lattice: &Lattice, code: CellCode, points: &Point) -> Voxel {
    let center = fixed_center(lattice, code);
    let [x, y, z, count] = *points;
    let from_center = |sum: i64, center: i64| sum.wrapping_sub(center.wrapping_mul(count));
    Voxel {
        count: u32::try_from(count).unwrap_or(u32::MAX),
        sum: [
            from_center(x, center[0]),
            from_center(y, center[1]),
            from_center(z, center[2]),
        ],
    }
}

/// The inverse of [`voxel_of`].
#[inline]
pub(super) fn points_of(lattice: &Lattice, code: CellCode, voxel: &Voxel) -> Point {
    let center = fixed_center(lattice, code);
    let count = i64::from(voxel.count);
    let from_datum = |i: usize| voxel.sum[i].wrapping_add(center[i].wrapping_mul(count));
    [from_datum(0), from_datum(1), from_datum(2), count]
}

/// Of second moments: offsets are counted in a 2^16th of the covering radius, so that the moments
/// of 2^31 points fit.
pub(super) fn moment_unit_m(lattice: &Lattice) -> f64 {
    lattice.covering_radius_m() / f64::from(1_u32 << 16)
}

/// What a point at `offset` from its cell's centre adds to the moments.
pub(super) fn moments_of(offset: [i64; 3], unit_m: f64) -> [i64; 6] {
    let [x, y, z] = offset.map(|o| nearest_integer(o as f64 * OFFSET_UNIT_M / unit_m));
    [x * x, x * y, x * z, y * y, y * z, z * z]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::LatticeKind;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn sums_wrap_and_come_back(kind in 0..5_usize, w in prop::array::uniform3(-1_000_000..1_000_000_i32), count in 1..u32::MAX, sum in prop::array::uniform3(-1_i64 << 52..1 << 52)) {
            let lattice = Lattice::new(LatticeKind::ALL[kind], 1e9).unwrap();
            let code = CellCode::pack(w).unwrap();
            let voxel = Voxel { count, sum };
            prop_assert_eq!(voxel_of(&lattice, code, &points_of(&lattice, code, &voxel)), voxel);
        }
    }
}
