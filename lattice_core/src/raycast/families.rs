//! Planes between neighbouring cells, and the inner loop of the ray traversal.

use nalgebra::{Matrix3, Vector3};
use wide::f64x2;

use super::packed::{self, Packed};
use crate::lattice::{Lattice, LatticeIndex};

/// Numerator of a family of planes that the ray does not cross.
const NEVER: f64 = 1e300;

/// Steps between two computations of the numerators from integers.
const ANCHOR_STEPS: u64 = 512;

/// Low bits of a parameter that hold the face index.
const TAG: u64 = 15;

/// Parameter from which a face counts as met at the end; the end decides the side.
const LAST: f64 = 1.0 - 1.0 / (1_u64 << 48) as f64;

/// Component of a ray per plane spacing below which it does not cross the planes.
const PARALLEL: f64 = 1.0 / (1_u64 << 50) as f64;

/// Change of state at the crossing of a face, in whole cache lines.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Crossing<const P: usize> {
    /// Addend to the numerators: Gram products with the vector of the face.
    add: [f64; P],
    /// Addend to the packed lattice index.
    step: u64,
}

/// Face pairs `+-n` of a cell, padded to `P`.
///
/// For a ray `s + t d` in the cell of lattice point `c`, the face `sigma n`, with `sigma` the sign of `n . d`, is
/// reached at `t = q / (n . d)`, where `q = sigma |n|^2 / 2 - n . (s - c)`. A crossing of face `k` adds the Gram
/// products `sigma_k n . n_k` to all `q`.
#[derive(Clone, Debug)]
pub(super) struct Families<const P: usize> {
    count: usize,
    normals: [Vector3<f64>; P],
    half_squares: [f64; P],
    /// Gram products of each normal with the basis.
    with_basis: [Vector3<f64>; P],
    /// Crossings: face `n_k` at `2 k`, `-n_k` at `2 k + 1`.
    crossings: [Crossing<P>; 16],
}

impl<const P: usize> Families<P> {
    /// Creates the families from one vector of each pair; at most `P` and 8 are used.
    pub(super) fn new(generator: &Matrix3<f64>, faces: &[LatticeIndex]) -> Families<P> {
        let faces = faces.get(..faces.len().min(P).min(8)).unwrap_or_default();
        let mut normals = [Vector3::zeros(); P];
        for (normal, w) in normals.iter_mut().zip(faces) {
            *normal = generator * Vector3::from(w.map(f64::from));
        }
        let none = Crossing {
            add: [0.0; P],
            step: 0,
        };
        let mut crossings = [none; 16];
        for (k, (w, normal)) in faces.iter().zip(&normals).enumerate() {
            let add = normals.map(|n| n.dot(normal));
            let step = packed::difference(*w);
            crossings[2 * k] = Crossing { add, step };
            crossings[2 * k + 1] = Crossing {
                add: add.map(|a| -a),
                step: step.wrapping_neg(),
            };
        }
        Families {
            count: faces.len(),
            normals,
            half_squares: normals.map(|n| 0.5 * n.norm_squared()),
            with_basis: normals.map(|n| generator.tr_mul(&n)),
            crossings,
        }
    }

    /// Start of rays: `s - c` for a point `s` in the cell of lattice point `c`, at index `cell`.
    pub(super) fn origin(&self, from_center_m: Vector3<f64>, cell: Packed) -> Origin<P> {
        Origin {
            cell,
            along: self.normals.map(|n| n.dot(&from_center_m)),
        }
    }

    /// Ray from `origin` that ends at `t = 1` after `direction_m`.
    #[inline(always)]
    pub(super) fn walk(&self, origin: &Origin<P>, direction_m: &Vector3<f64>) -> Walk<P> {
        let mut walk = Walk {
            q: [NEVER; P],
            inverse: [1.0; P],
            tag: [0.0; P],
            cell: origin.cell,
        };
        for j in 0..P {
            let along = self.normals[j].dot(direction_m);
            let sign = if along < 0.0 { -1.0 } else { 1.0 };
            let crosses = along.abs() > PARALLEL * self.half_squares[j];
            let q = sign * self.half_squares[j] - origin.along[j];
            walk.q[j] = if crosses { q } else { NEVER };
            walk.inverse[j] = if crosses { 1.0 / along } else { 1.0 };
            walk.tag[j] = f64::from_bits(2 * j as u64 + u64::from(along < 0.0));
        }
        walk
    }

    /// One step of a ray: the cell that it leaves before `t = 1`; `None` at its end.
    ///
    /// Several rays are interleaved, since each step of one depends on the one before.
    #[inline(always)]
    pub(super) fn step(&self, origin: &Origin<P>, ray: &mut Ray<P>) -> Option<Packed> {
        let t = ray.walk.next_exit();
        if t >= LAST {
            return None;
        }
        let left = ray.walk.cell;
        self.cross(&mut ray.walk, t);
        ray.steps += 1;
        if ray.steps.is_multiple_of(ANCHOR_STEPS) {
            self.anchor(origin, &mut ray.walk);
            if ray.steps >= ray.limit {
                ray.walk.end();
            }
        }
        Some(left)
    }

    /// Crosses the face whose tag `t` carries.
    #[inline(always)]
    fn cross(&self, walk: &mut Walk<P>, t: f64) {
        let crossing = &self.crossings[(t.to_bits() & TAG) as usize];
        for j in 0..P {
            walk.q[j] += crossing.add[j];
        }
        walk.cell = walk.cell.plus(crossing.step);
    }

    /// Recomputes the numerators from the integer index, so that rounding errors do not accumulate.
    #[inline(never)]
    fn anchor(&self, origin: &Origin<P>, walk: &mut Walk<P>) {
        let (from, at) = (origin.cell.unpack(), walk.cell.unpack());
        let gone = Vector3::new(
            f64::from(at[0] - from[0]),
            f64::from(at[1] - from[1]),
            f64::from(at[2] - from[2]),
        );
        for j in 0..self.count {
            if walk.q[j] < 0.5 * NEVER {
                let sign = if walk.inverse[j] < 0.0 { -1.0 } else { 1.0 };
                walk.q[j] =
                    sign * self.half_squares[j] - origin.along[j] + self.with_basis[j].dot(&gone);
            }
        }
    }
}

/// Start of rays: its cell and its offset from the lattice point along each normal.
#[derive(Clone, Copy, Debug)]
pub(super) struct Origin<const P: usize> {
    pub(super) cell: Packed,
    along: [f64; P],
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Walk<const P: usize> {
    q: [f64; P],
    inverse: [f64; P],
    /// Face indices as bits.
    tag: [f64; P],
    pub(super) cell: Packed,
}

/// Interleaved ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ray<const P: usize> {
    pub(super) walk: Walk<P>,
    pub(super) steps: u64,
    /// Upper bound of the steps; 0 for a ray that has ended.
    pub(super) limit: u64,
}

impl<const P: usize> Walk<P> {
    /// Leaves no face to be crossed.
    fn end(&mut self) {
        (self.q, self.inverse) = ([NEVER; P], [1.0; P]);
    }

    /// Parameter at which the ray leaves its cell; its low bits are the face index.
    #[inline(always)]
    fn next_exit(&self) -> f64 {
        // Two lanes throughout, so that SSE2 suffices.
        let untagged = f64x2::splat(f64::from_bits(!TAG));
        let pair = |j: usize| {
            let two = |values: &[f64; P]| f64x2::new([values[j], values[j + 1]]);
            ((two(&self.q) * two(&self.inverse)) & untagged) | two(&self.tag)
        };
        let mut least = pair(0);
        for j in (2..P).step_by(2) {
            least = least.fast_min(pair(j));
        }
        let [a, b] = least.to_array();
        if a < b { a } else { b }
    }
}

/// One face vector of each pair `+-n` of a lattice.
pub(super) fn face_pairs(lattice: &Lattice) -> Vec<LatticeIndex> {
    let faces = lattice.face_neighbors().iter().copied();
    faces.filter(|w| *w > w.map(|i| -i)).collect()
}
