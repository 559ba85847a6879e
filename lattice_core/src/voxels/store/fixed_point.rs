//! Positions in fixed point.

use wide::u32x4;

use crate::lattice::{BatchBlock, BatchQuantizer, BlockKey, Coordinate, Lattice, nearest_integer};
use crate::voxels::{OFFSET_UNIT_M, Voxel};

const PER_METRE: f64 = 1.0 / OFFSET_UNIT_M;

/// Sums of positions relative to the datum in `OFFSET_UNIT_M`, modulo 2^32, and the number of points.
///
/// With a known cell, the sums of [`most_points`] are determined by its centre.
pub(crate) type Point = u32x4;

/// Sums of offsets from the centre of a cell in `OFFSET_UNIT_M`, and the number of points.
pub(crate) type Offsets = [i64; 4];

/// Maximum distance of a point from its lattice point, in `OFFSET_UNIT_M`, rounding included.
pub(crate) fn reach(lattice: &Lattice) -> u64 {
    (lattice.covering_radius_m() * PER_METRE) as u64 + 2
}

/// Maximum number of points of a cell whose offset sums fit 32 bits; at least 1 for any covering radius.
pub(crate) fn most_points(lattice: &Lattice) -> u32 {
    (i32::MAX as u64 / reach(lattice)).max(1) as u32
}

/// Converts a position (metres) to `OFFSET_UNIT_M`.
#[inline(always)]
pub(crate) fn fixed(metres: [f64; 3]) -> [i64; 3] {
    metres.map(|m| nearest_integer(m * PER_METRE))
}

/// Points of a block in fixed point relative to the datum.
///
/// The base is rounded, then the offset, so the result does not depend on the other points of a cloud or on its
/// division into blocks.
#[derive(Clone, Copy)]
pub(crate) struct FixedBlock<'a, T> {
    base: Point,
    offsets_m: &'a [[T; 3]],
    near: Option<&'a [[i32; BatchQuantizer::BLOCK]; 3]>,
}

impl<'a, T: Coordinate> FixedBlock<'a, T> {
    /// Creates points at `base_m + offset`.
    pub(crate) fn new(
        base_m: [f64; 3],
        offsets_m: &'a [[T; 3]],
        block: &BatchBlock<'a>,
    ) -> FixedBlock<'a, T> {
        FixedBlock {
            base: point_at(fixed(base_m).map(low), 0),
            offsets_m,
            near: (!block.sums.far).then_some(block.fixed),
        }
    }

    /// Coordinates relative to the base, unless a point is too far.
    #[inline(always)]
    pub(crate) fn near(&self) -> Option<(&[[i32; BatchQuantizer::BLOCK]; 3], Point)> {
        Some((self.near?, self.base))
    }

    /// Point `i`.
    #[inline(always)]
    pub(crate) fn point(&self, i: usize) -> Point {
        match self.near {
            Some(near) => near_point(near, self.base, i),
            None => self.base + point_at(self.far(i), 1),
        }
    }

    #[cold]
    fn far(&self, i: usize) -> [u32; 3] {
        let offset = self.offsets_m.get(i).map(|offset| offset.map(T::into));
        fixed(offset.unwrap_or_default()).map(low)
    }
}

/// Point `i` of a block whose coordinates relative to the base fit 32 bits.
#[inline(always)]
pub(crate) fn near_point(
    [x, y, z]: &[[i32; BatchQuantizer::BLOCK]; 3],
    base: Point,
    i: usize,
) -> Point {
    let i = i % BatchQuantizer::BLOCK;
    base + point_at([x[i], y[i], z[i]].map(|c| c as u32), 1)
}

#[inline(always)]
fn point_at([x, y, z]: [u32; 3], count: u32) -> Point {
    Point::new([x, y, z, count])
}

/// Modulo 2^32.
#[inline(always)]
fn low(value: i64) -> u32 {
    value as u32
}

/// Centre of a cell relative to the datum, modulo 2^32.
#[inline]
fn low_center(lattice: &Lattice, code: BlockKey) -> [u32; 3] {
    fixed(lattice.center(code.unpack()).into()).map(low)
}

/// Converts at most [`most_points`] of a cell to offsets from its centre.
#[inline]
pub(crate) fn offsets_of(lattice: &Lattice, code: BlockKey, points: &Point) -> Offsets {
    let center = low_center(lattice, code);
    let [x, y, z, count] = points.to_array();
    let offset = |sum: u32, center: u32| {
        let rest = sum.wrapping_sub(center.wrapping_mul(count));
        i64::from(rest as i32)
    };
    [
        offset(x, center[0]),
        offset(y, center[1]),
        offset(z, center[2]),
        i64::from(count),
    ]
}

/// Inverse of [`offsets_of`].
#[inline]
pub(crate) fn points_of(lattice: &Lattice, code: BlockKey, offsets: &Offsets) -> Point {
    let center = low_center(lattice, code);
    let [.., count] = offsets.map(low);
    let sum = |i: usize| low(offsets[i]).wrapping_add(center[i].wrapping_mul(count));
    Point::new([sum(0), sum(1), sum(2), count])
}

/// Voxel of these points.
#[inline]
pub(crate) fn voxel_of([x, y, z, count]: Offsets) -> Voxel {
    Voxel {
        count: u32::try_from(count).unwrap_or(u32::MAX),
        sum: [x, y, z],
    }
}

/// Points of a voxel.
#[inline]
pub(crate) fn offsets_in(voxel: &Voxel) -> Offsets {
    let [x, y, z] = voxel.sum;
    [x, y, z, i64::from(voxel.count)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::LatticeKind;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn sums_wrap_and_come_back(
            kind in 0..5_usize,
            log_side in -6.0..9.9_f64,
            w in prop::array::uniform3(-1_000_000..1_000_000_i32),
            share in 0.0..=1.0,
            sum in prop::array::uniform3(-1.0..=1.0),
        ) {
            let lattice = Lattice::new(LatticeKind::ALL[kind], log_side.exp2().powi(3)).unwrap();
            let code = BlockKey::pack(w).unwrap();
            let most = i64::from(most_points(&lattice));
            let count = ((most as f64 * share) as i64 + 1).min(most);
            let reach = reach(&lattice) as i64;
            let [x, y, z] = sum.map(|s: f64| (s * (count * reach) as f64) as i64);
            let offsets = [x, y, z, count];
            let points = points_of(&lattice, code, &offsets);
            prop_assert_eq!(offsets_of(&lattice, code, &points), offsets);
        }
    }
}
