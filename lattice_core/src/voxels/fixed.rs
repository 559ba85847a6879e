//! Positions in fixed point.

use super::shard::Point;
use super::{OFFSET_UNIT_M, Voxel};
use crate::lattice::{BatchQuantizer, CellCode, Lattice, nearest_integer};

const PER_METRE: f64 = 1.0 / OFFSET_UNIT_M;

/// A position (metres) in `OFFSET_UNIT_M`.
#[inline(always)]
pub(super) fn fixed(metres: [f64; 3]) -> [i64; 3] {
    metres.map(|m| nearest_integer(m * PER_METRE))
}

/// The points at `base_m + offset` in fixed point.
#[inline]
pub(super) fn fixed_points(
    base_m: [f64; 3],
    offsets_m: &[[f32; 3]],
    out: &mut [Point; BatchQuantizer::BLOCK],
) {
    for (point, offset) in out.iter_mut().zip(offsets_m) {
        let [x, y, z] = [0, 1, 2].map(|i| base_m[i] + f64::from(offset[i]));
        let [x, y, z] = fixed([x, y, z]);
        *point = [x, y, z, 1];
    }
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
