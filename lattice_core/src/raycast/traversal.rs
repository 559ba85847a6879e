//! The cells that a segment passes through.

use std::ops::ControlFlow;

use nalgebra::Vector3;
use thiserror::Error;

use super::families::{Families, face_pairs};
use super::packed::{self, Packed};
use crate::lattice::{Lattice, LatticeIndex};

/// A segment that was not followed.
#[derive(Clone, Copy, PartialEq, Debug, Error)]
pub enum TraversalError {
    /// A coordinate is NaN or infinite.
    #[error("an end of the segment is NaN or infinite")]
    NotFinite,
    /// An end is too far from the lattice point 0 for the indices of its cells.
    #[error("an end of the segment is more than {0} cells from the lattice point 0")]
    OutOfRange(i32),
}

/// Follows segments through the cells of a lattice, exactly.
///
/// Within a cell the next face is the one that the segment reaches first, among the planes halfway
/// to the face neighbours; there are at most 7 pairs. Successive cells share a face and the last cell
/// is that of the end point, on any input. The numerators are sums of Gram
/// products that are computed anew every 512 steps, so that a segment of `L` cell sides is followed
/// to within some `600 L 2^-53` cell sides: cells that it crosses over a shorter length than that
/// may be missing or be added, no others.
#[derive(Clone, Debug)]
pub struct Traversal {
    pub(super) lattice: Lattice,
    pub(super) kernel: Kernel,
    faces: Vec<Face>,
    index_limit: i32,
    cells_per_metre: f64,
    cells_at_ends: f64,
}

/// The families padded to a whole number of SIMD registers.
// One for each traversal, which lives long: a box would save nothing.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Debug)]
pub(super) enum Kernel {
    /// Up to 4 pairs of faces: cubic, hexagonal prisms.
    Four(Families<4>),
    /// Up to 6: FCC.
    Six(Families<6>),
    /// Any lattice.
    Eight(Families<8>),
}

/// Binds `$families` to the families of a kernel, whatever their number.
macro_rules! with_families {
    ($kernel:expr, $families:ident => $body:expr) => {
        match $kernel {
            Kernel::Four($families) => $body,
            Kernel::Six($families) => $body,
            Kernel::Eight($families) => $body,
        }
    };
}
pub(super) use with_families;

#[derive(Clone, Copy, Debug)]
struct Face {
    step: LatticeIndex,
    normal: Vector3<f64>,
}

impl Traversal {
    /// Prepares the traversal of a lattice.
    pub fn new(lattice: &Lattice) -> Traversal {
        let (generator, pairs) = (lattice.generator(), face_pairs(lattice));
        let kernel = match pairs.len() {
            0..=4 => Kernel::Four(Families::new(&generator, &pairs)),
            5 | 6 => Kernel::Six(Families::new(&generator, &pairs)),
            _ => Kernel::Eight(Families::new(&generator, &pairs)),
        };
        let face = |step: &LatticeIndex| Face {
            step: *step,
            normal: generator * Vector3::from(step.map(f64::from)),
        };
        // The cells that touch a segment lie within the covering radius of it, their points within
        // twice that: the volume of this capsule bounds their number.
        let (reach, volume) = (2.0 * lattice.covering_radius_m(), lattice.cell_volume_m3());
        Traversal {
            faces: lattice.face_neighbors().iter().map(face).collect(),
            index_limit: (1 << 20) - 4 * index_margin(lattice),
            cells_per_metre: 3.2 * reach * reach / volume,
            cells_at_ends: 4.2 * reach * reach * reach / volume + 8.0,
            lattice: lattice.clone(),
            kernel,
        }
    }

    /// The lattice.
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// Calls `visit` with every cell that the segment touches, in order, from the cell of `from_m` to
    /// the cell of `to_m` (metres from the lattice point 0), until it breaks.
    ///
    /// At an edge or a vertex the segment takes one of the ways around. Returns the
    /// number of cells visited. Fails if an end is not finite or out of range, before any visit.
    pub fn walk(
        &self,
        from_m: &Vector3<f64>,
        to_m: &Vector3<f64>,
        mut visit: impl FnMut(LatticeIndex) -> ControlFlow<()>,
    ) -> Result<u64, TraversalError> {
        let (start, end) = (self.cell_of(from_m)?, self.cell_of(to_m)?);
        let direction = to_m - from_m;
        let limit = self.most_steps(direction.norm());
        let mut stopped = false;
        let (mut cell, mut visited) = with_families!(&self.kernel, families => {
            let from_center = from_m - self.lattice.center(start.unpack());
            let origin = families.origin(from_center, start);
            let mut walk = families.walk(&origin, &direction);
            let steps = families.run(&origin, &mut walk, limit, |cell| {
                if cell == end {
                    return false;
                }
                stopped = visit(cell.unpack()).is_break();
                !stopped
            });
            (walk.cell, steps + u64::from(stopped))
        });
        // The end may lie on the border of the cell that was reached.
        while !stopped {
            visited += 1;
            stopped = visit(cell.unpack()).is_break() || cell == end;
            cell = self.toward(cell, end, &direction);
        }
        Ok(visited)
    }

    /// [`Traversal::walk`] into a vector.
    pub fn cells(
        &self,
        from_m: &Vector3<f64>,
        to_m: &Vector3<f64>,
    ) -> Result<Vec<LatticeIndex>, TraversalError> {
        let mut cells = Vec::new();
        self.walk(from_m, to_m, |w| {
            cells.push(w);
            ControlFlow::Continue(())
        })?;
        Ok(cells)
    }

    /// The cell of a point, if rays can start and end there.
    pub(super) fn cell_of(&self, p_m: &Vector3<f64>) -> Result<Packed, TraversalError> {
        if !p_m.iter().all(|x| x.is_finite()) {
            return Err(TraversalError::NotFinite);
        }
        let cell = self.lattice.quantize(p_m).and_then(|w| self.in_range(w));
        cell.ok_or(TraversalError::OutOfRange(self.index_limit))
    }

    /// The cell, if rays can start and end there: no cell of any ray has an index out of range.
    #[inline]
    pub(super) fn in_range(&self, w: LatticeIndex) -> Option<Packed> {
        let near = |i: i32| i.abs() < self.index_limit;
        (near(w[0]) & near(w[1]) & near(w[2])).then(|| Packed::new(w))?
    }

    /// No segment of this length touches more cells.
    pub(super) fn most_steps(&self, length_m: f64) -> u64 {
        (self.cells_per_metre * length_m + self.cells_at_ends) as u64
    }

    /// A face neighbour of `cell` nearer to `end`, which is another cell.
    ///
    /// If both touch in an edge or a vertex, so does the neighbour: it is one whose plane holds the
    /// point halfway, where `n . delta = |n|^2`, the largest value that there is for such `delta`.
    /// Otherwise a neighbour with `n . delta > |n|^2 / 2`, which always exists, is nearer too. Of
    /// equals it takes the one that is farthest along the ray, which has not been there.
    #[cold]
    fn toward(&self, cell: Packed, end: Packed, direction: &Vector3<f64>) -> Packed {
        let (at, to) = (cell.unpack(), end.unpack());
        let delta = [0, 1, 2].map(|i| f64::from(to[i] - at[i]));
        let delta = self.lattice.generator() * Vector3::from(delta);
        let (mut best, mut far, mut next) = (0.5, 0.0, end);
        for face in &self.faces {
            let part = face.normal.dot(&delta) / face.normal.norm_squared();
            let along = face.normal.dot(direction);
            if part > best + 1e-9 || (part > best - 1e-9 && along > far) {
                (best, far) = (part.max(best), along);
                next = cell.plus(packed::difference(face.step));
            }
        }
        next
    }
}

/// No cell of a point has an index that differs by more from the point's real-valued index.
fn index_margin(lattice: &Lattice) -> i32 {
    let Some(inverse) = lattice.generator().try_inverse() else {
        return 1 << 19;
    };
    let row = |i: usize| inverse.row(i).norm() * lattice.covering_radius_m();
    let most = (0..3).map(row).fold(0.0, f64::max);
    (most.ceil() + 1.0).min(f64::from(1 << 18)) as i32
}
