//! Index of a lattice point, and its place.

use nalgebra::{Matrix3, Vector3};

/// Lattice point as integer coordinates `w` in the basis of the paper, or in the given one.
pub type LatticeIndex = [i32; 3];

#[inline(always)]
pub(super) fn center(g: &Matrix3<f64>, w: LatticeIndex) -> Vector3<f64> {
    combine(g, w.map(f64::from))
}

/// `G w` in a fixed order of operations.
#[inline(always)]
pub(super) fn combine(g: &Matrix3<f64>, w: [f64; 3]) -> Vector3<f64> {
    Vector3::new(
        g.m11 * w[0] + g.m12 * w[1] + g.m13 * w[2],
        g.m21 * w[0] + g.m22 * w[1] + g.m23 * w[2],
        g.m31 * w[0] + g.m32 * w[1] + g.m33 * w[2],
    )
}
