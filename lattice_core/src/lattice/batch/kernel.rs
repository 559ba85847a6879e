//! Eight points at a time in single precision, with a certificate for each.
//!
//! `u = M p + phi` is computed in f32. Every decision (three roundings and the choice of the copy) is compared with
//! an error bound of `u`. A point closer to a cell border than the bound is decided in double precision instead. A
//! decided point has the cell of exact arithmetic.

use std::num::Wrapping;

use super::form::Form;
use crate::lattice::BlockKey;

/// Points quantized together.
pub(crate) const BLOCK: usize = 128;

/// Addend that leaves a float, rounded half to even, as an integer in its low bits.
const ROUND: f32 = 1.5 * (1_u32 << 23) as f32;

/// Resolution of the statistics: fraction of a cell side (and of its square).
pub(crate) const STEPS: f32 = (1_u32 << 20) as f32;

#[derive(Clone, Copy, Debug)]
pub(super) struct Constants {
    /// `M`, row by row: cuboid sides per metre.
    pub(super) rows: [[f32; 3]; 3],
    /// `phi`, at most a half.
    pub(super) phase: [f32; 3],
    /// Index of the lattice point of the phase, plus 2^20.
    pub(super) base: [i32; 3],
    /// Squared sides relative to the first.
    pub(super) weights: [f32; 3],
    pub(super) threshold: f32,
    /// Ratio of the error bound of `weights . |rest|` to that of `u`.
    pub(super) excess_per_error: f32,
    /// Squared sides of the cuboid relative to the squared cell side (cube root of the volume).
    pub(super) squared_sides: [f32; 3],
    /// Error bound of each `u`: `error_per_metre * (|x| + |y| + |z|) + error`.
    pub(super) error_per_metre: f32,
    pub(super) error: f32,
    /// Limit of `|x| + |y| + |z|` (metres) above which a point stays undecided.
    pub(super) reach_m: f32,
}

#[derive(Clone, Copy)]
pub(super) struct Lane {
    /// Low and high half.
    pub(super) code: [u32; 2],
    /// All ones if decided.
    pub(super) decided: i32,
    /// Distance from the lattice point, and its square, in units of 1/`STEPS`.
    pub(super) distance: i32,
    pub(super) square: i32,
}

#[inline(always)]
fn nearest(u: f32) -> (i32, f32) {
    let sum = u + ROUND;
    let near = (sum.to_bits() as i32).wrapping_sub(ROUND.to_bits() as i32);
    (near, u - (sum - ROUND))
}

/// Rounds a number in [0, 2^22) to an integer.
#[inline(always)]
pub(super) fn to_int(v: f32) -> i32 {
    nearest(v).0
}

/// Coordinate below `FIXED_REACH_M` in 2^-20 m, half to even: first with 12 bits less, then the exact remainder.
#[inline(always)]
fn to_fixed(metres: f32) -> i32 {
    let (high, rest) = nearest(metres * 256.0);
    (high << 12).wrapping_add(to_int(rest * 4096.0))
}

#[inline(always)]
pub(super) fn lane<F: Form, const DIAGONAL: bool>(c: &Constants, [x, y, z]: [f32; 3]) -> Lane {
    let [r0, r1, r2] = &c.rows;
    let u = if DIAGONAL {
        [r0[0] * x, r1[1] * y, r2[2] * z]
    } else {
        [
            r0[0] * x + r0[1] * y + r0[2] * z,
            r1[0] * x + r1[1] * y + r1[2] * z,
            r2[0] * x + r2[1] * y + r2[2] * z,
        ]
    };
    let (near_x, rest_x) = nearest(u[0] + c.phase[0]);
    let (near_y, rest_y) = nearest(u[1] + c.phase[1]);
    let (near_z, rest_z) = nearest(u[2] + c.phase[2]);
    let (ax, ay, az) = (rest_x.abs(), rest_y.abs(), rest_z.abs());
    let size = x.abs() + y.abs() + z.abs();
    let error = size * c.error_per_metre + c.error;
    let mut doubled = [near_x, near_y, near_z].map(|near| Wrapping(near) << 1);
    // Distances along the axes from the chosen point. Near one half, the next point along the axis is equally near.
    let (mut dx, mut dy, mut dz) = (ax, ay, az);
    // False for NaN of any origin.
    let mut decided = size < c.reach_m;
    if F::CENTRED {
        let mut excess = c.weights[0] * ax + c.weights[1] * ay;
        if F::CENTRED_Z {
            excess += c.weights[2] * az;
        }
        excess -= c.threshold;
        decided &= excess.abs() > error * c.excess_per_error;
        let other = excess > 0.0;
        let mask = -i32::from(other);
        let half = if other { 0.5 } else { 0.0 };
        let towards = |rest: f32| Wrapping(((rest.to_bits() as i32 >> 31) | 1) & mask);
        doubled[0] += towards(rest_x);
        doubled[1] += towards(rest_y);
        (dx, dy) = ((ax - half).abs(), (ay - half).abs());
        if F::CENTRED_Z {
            doubled[2] += towards(rest_z);
            dz = (az - half).abs();
        }
    }
    let inside = 0.5 - error;
    decided &= (dx < inside) & (dy < inside) & (dz < inside);
    let w = F::index(doubled);
    let offset = [0, 1, 2].map(|i| w[i].0.wrapping_add(c.base[i]) as u32);
    let s = &c.squared_sides;
    let square = s[0] * (dx * dx) + s[1] * (dy * dy) + s[2] * (dz * dz);
    Lane {
        code: BlockKey::halves(offset),
        decided: -i32::from(decided),
        distance: to_int(square.sqrt() * STEPS),
        square: to_int(square * STEPS),
    }
}

/// Coordinate (metres) below which units of 2^-20 m fit 32 bits.
pub(super) const FIXED_REACH_M: f32 = 2000.0;

/// Codes and decision masks of a block of points.
#[derive(Clone)]
pub(super) struct Lanes {
    pub(super) codes: [BlockKey; BLOCK],
    /// All ones if decided.
    pub(super) decided: [i32; BLOCK],
    /// Points in 2^-20 m by axis; only with statistics.
    pub(super) fixed: [[i32; BLOCK]; 3],
}

impl Default for Lanes {
    fn default() -> Lanes {
        Lanes {
            codes: [BlockKey::NONE; BLOCK],
            decided: [0; BLOCK],
            fixed: [[0; BLOCK]; 3],
        }
    }
}

impl Lanes {
    /// One bit per eight points that are not all decided.
    #[inline]
    pub(super) fn open(&self) -> u32 {
        let groups = self.decided.as_chunks::<8>().0.iter();
        groups.rev().fold(0_u32, |open, marks| {
            open << 1 | u32::from(marks.iter().fold(-1, |all, mark| all & mark) == 0)
        })
    }
}

/// Sums over the decided points of a block.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct LaneSums {
    pub(super) distances: i32,
    pub(super) squares: i32,
    pub(super) largest_square: i32,
}

#[inline(always)]
#[allow(clippy::needless_range_loop)] // Several arrays side by side.
pub(super) fn block<F: Form, const DIAGONAL: bool, const STATISTICS: bool>(
    c: &Constants,
    points: &[[f32; 3]; BLOCK],
    out: &mut Lanes,
) -> LaneSums {
    // One loop per number width, so that the vectors of each are full.
    let mut axes = [[0.0; BLOCK]; 3];
    for i in 0..BLOCK {
        let [x, y, z] = points[i];
        (axes[0][i], axes[1][i], axes[2][i]) = (x, y, z);
    }
    let mut codes = [[0_u32; BLOCK]; 2];
    let mut sums = LaneSums::default();
    for i in 0..BLOCK {
        let lane = lane::<F, DIAGONAL>(c, [axes[0][i], axes[1][i], axes[2][i]]);
        (codes[0][i], codes[1][i]) = (lane.code[0], lane.code[1]);
        out.decided[i] = lane.decided;
        if STATISTICS {
            sums.distances = sums.distances.wrapping_add(lane.distance & lane.decided);
            sums.squares = sums.squares.wrapping_add(lane.square & lane.decided);
            sums.largest_square = sums.largest_square.max(lane.square & lane.decided);
        }
    }
    if STATISTICS {
        for (fixed, axis) in out.fixed.iter_mut().zip(&axes) {
            for (fixed, offset) in fixed.iter_mut().zip(axis) {
                *fixed = to_fixed(*offset);
            }
        }
    }
    for i in 0..BLOCK {
        out.codes[i] = BlockKey::from_halves([codes[0][i], codes[1][i]]);
    }
    sums
}
