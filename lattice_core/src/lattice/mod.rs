//! Lattices: generators, exact quantizers, neighbours, Voronoi cells and keys.
//!
//! A lattice is all `G w` for integer `w`, with the generator matrix `G` of Ryde & Brünig 2011,
//! eq. (8)-(12), scaled to a cell volume. [`Lattice::quantize`] finds the cell of a point.

mod batch;
mod closed_form;
mod code;
mod generator;
mod key;
mod kind;
mod neighbors;
mod voronoi;

use std::fmt;
use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};
use thiserror::Error;

use closed_form::{ClosedForm, Quantizer, with_form};

pub use batch::{BatchBlock, BatchQuantizer, BatchSums, Simd};
pub(crate) use closed_form::nearest_integer;
pub use code::CellCode;
pub use key::Key;
pub use kind::LatticeKind;
pub use voronoi::{CellFace, VoronoiCell};

/// A lattice point as integer coordinates `w` in the basis that the paper prints.
pub type LatticeIndex = [i32; 3];

/// Smallest cell volume, m^3: cells of 1 mm.
pub const MIN_CELL_VOLUME_M3: f64 = 1e-9;
/// Largest cell volume, m^3: cells of 1 km.
pub const MAX_CELL_VOLUME_M3: f64 = 1e9;

/// Indices of [`Lattice::quantize`] are smaller than this.
const INDEX_LIMIT: u64 = 1 << 20;

/// What is wrong with the description of a lattice.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum LatticeError {
    /// No lattice has this name.
    #[error("unknown lattice {0:?}: use one of cubic, bcc, fcc, mcc, hex")]
    UnknownName(String),
    /// The cell volume is not a number, or too small or large.
    #[error("cell volume {0} m^3 is not between {MIN_CELL_VOLUME_M3} and {MAX_CELL_VOLUME_M3} m^3")]
    CellVolume(f64),
}

/// A lattice of one kind and cell volume. Cheap to clone.
#[derive(Clone)]
pub struct Lattice {
    quantizer: Quantizer,
    generator: Matrix3<f64>,
    shape: Arc<Shape>,
}

struct Shape {
    kind: LatticeKind,
    cell_volume_m3: f64,
    cell: VoronoiCell,
    covering_radius_m: f64,
    packing_radius_m: f64,
}

impl Lattice {
    /// The lattice with cells of `cell_volume_m3`, axes as the paper prints them.
    ///
    /// Fails outside of [`MIN_CELL_VOLUME_M3`] to [`MAX_CELL_VOLUME_M3`].
    pub fn new(kind: LatticeKind, cell_volume_m3: f64) -> Result<Lattice, LatticeError> {
        if !(MIN_CELL_VOLUME_M3..=MAX_CELL_VOLUME_M3).contains(&cell_volume_m3) {
            return Err(LatticeError::CellVolume(cell_volume_m3));
        }
        let generator = generator::unit_generator(kind) * generator::cube_root(cell_volume_m3);
        let cell = VoronoiCell::new(&generator, neighbors::faces(kind));
        let covering_radius_m = cell.vertices.iter().map(|v| v.norm()).fold(0.0, f64::max);
        let nearest = |w: &LatticeIndex| 0.5 * center(&generator, *w).norm();
        let packing_radius_m = neighbors::faces(kind)
            .iter()
            .map(nearest)
            .fold(f64::MAX, f64::min);
        let shape = Shape {
            kind,
            cell_volume_m3,
            cell,
            covering_radius_m,
            packing_radius_m,
        };
        Ok(Lattice {
            quantizer: Quantizer::new(kind, &generator),
            generator,
            shape: Arc::new(shape),
        })
    }

    /// Which lattice it is.
    pub fn kind(&self) -> LatticeKind {
        self.shape.kind
    }

    /// Volume of a cell, m^3.
    pub fn cell_volume_m3(&self) -> f64 {
        self.shape.cell_volume_m3
    }

    /// Side of a cube of the cell's volume, metres.
    pub fn cell_side_m(&self) -> f64 {
        generator::cube_root(self.cell_volume_m3())
    }

    /// The generator `G`: columns are the basis vectors, metres.
    pub fn generator(&self) -> Matrix3<f64> {
        self.generator
    }

    /// The lattice point nearest to `p` (metres), exactly; eq. (2) in closed form.
    ///
    /// `None` if `p` is not finite or an index would reach 2^20 in magnitude. On a border between
    /// cells the answer is one of them, the same on every machine.
    #[inline]
    pub fn quantize(&self, p: &Vector3<f64>) -> Option<LatticeIndex> {
        with_form!(self.quantizer, form => form.nearest([p.x, p.y, p.z]).and_then(narrow))
    }

    /// [`Lattice::quantize`] for many points (metres): `visit` gets each point and its answer.
    #[inline]
    pub fn quantize_each(
        &self,
        points_m: impl IntoIterator<Item = [f64; 3]>,
        mut visit: impl FnMut([f64; 3], Option<LatticeIndex>),
    ) {
        with_form!(self.quantizer, form => {
            for p in points_m {
                visit(p, form.nearest(p).and_then(narrow));
            }
        })
    }

    /// [`Lattice::quantize`] with 64-bit indices, up to some 2^48 cells from 0.
    pub fn quantize_wide(&self, p: &Vector3<f64>) -> Option<[i64; 3]> {
        with_form!(self.quantizer, form => form.nearest([p.x, p.y, p.z]))
    }

    /// The lattice point `G w`, metres.
    #[inline]
    pub fn center(&self, w: LatticeIndex) -> Vector3<f64> {
        center(&self.generator, w)
    }

    /// [`Lattice::center`] for 64-bit indices; exact to the rounding of f64.
    pub fn center_wide(&self, w: [i64; 3]) -> Vector3<f64> {
        combine(&self.generator, w.map(|i| i as f64))
    }

    /// Index differences to the cells that share a face.
    pub fn face_neighbors(&self) -> &'static [LatticeIndex] {
        neighbors::faces(self.kind())
    }

    /// Index differences to the cells that share a face, an edge or a vertex; faces come first.
    pub fn touching_neighbors(&self) -> &'static [LatticeIndex] {
        neighbors::touching(self.kind())
    }

    /// The Voronoi cell around the lattice point 0.
    pub fn cell(&self) -> &VoronoiCell {
        &self.shape.cell
    }

    /// Largest distance of any point from its lattice point, metres.
    pub fn covering_radius_m(&self) -> f64 {
        self.shape.covering_radius_m
    }

    /// Smallest distance of the cell's surface from its lattice point, metres.
    pub fn packing_radius_m(&self) -> f64 {
        self.shape.packing_radius_m
    }
}

/// Equal if every index means the same point, to the bit.
impl PartialEq for Lattice {
    fn eq(&self, other: &Lattice) -> bool {
        self.kind() == other.kind() && self.cell_volume_m3() == other.cell_volume_m3()
    }
}

impl fmt::Debug for Lattice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Lattice({}, {} m^3)", self.kind(), self.cell_volume_m3())
    }
}

#[inline(always)]
fn narrow(w: [i64; 3]) -> Option<LatticeIndex> {
    let fits = |i: i64| i.unsigned_abs() < INDEX_LIMIT;
    (fits(w[0]) & fits(w[1]) & fits(w[2])).then(|| w.map(|i| i as i32))
}

#[inline(always)]
fn center(g: &Matrix3<f64>, w: LatticeIndex) -> Vector3<f64> {
    combine(g, w.map(f64::from))
}

/// `G w` in a fixed order of operations. Every generator is upper triangular.
#[inline(always)]
fn combine(g: &Matrix3<f64>, w: [f64; 3]) -> Vector3<f64> {
    Vector3::new(
        g.m11 * w[0] + g.m12 * w[1] + g.m13 * w[2],
        g.m22 * w[1] + g.m23 * w[2],
        g.m33 * w[2],
    )
}

#[cfg(test)]
mod tests;
