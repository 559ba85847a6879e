//! Planes and bounds of a lattice for the traversal of its cells.

use nalgebra::Vector3;

use super::families::{Families, face_pairs};
use super::packed::Packed;
use crate::lattice::{Lattice, LatticeIndex};

/// Reason that no ray can start or end at a point.
pub(super) enum Outside {
    NotFinite,
    /// Too many cells from lattice point 0.
    OutOfRange,
}

/// Face neighbours of a lattice for exact ray traversal.
///
/// Within a cell the next face is the first that the ray reaches among the planes halfway to the face neighbours;
/// there are at most 7 pairs. The numerators are sums of Gram products, recomputed every 512 steps. A ray of `L` cell
/// sizes is followed to within `600 L 2^-53` cell sizes: only cells crossed over a shorter length may be missed or
/// added.
#[derive(Clone, Debug)]
pub(super) struct Traversal {
    pub(super) lattice: Lattice,
    pub(super) kernel: Kernel,
    index_limit: i32,
    cells_per_metre: f64,
    cells_at_ends: f64,
}

/// Families padded to a whole number of SIMD registers.
// One per long-lived traversal: a box would save nothing.
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

impl Traversal {
    pub(super) fn new(lattice: &Lattice) -> Traversal {
        let (generator, pairs) = (lattice.generator(), face_pairs(lattice));
        let kernel = match pairs.len() {
            0..=4 => Kernel::Four(Families::new(&generator, &pairs)),
            5 | 6 => Kernel::Six(Families::new(&generator, &pairs)),
            _ => Kernel::Eight(Families::new(&generator, &pairs)),
        };
        // The cells that touch a ray lie within the covering radius of it, their points within twice that. The volume
        // of this capsule bounds their number.
        let (reach, volume) = (2.0 * lattice.covering_radius_m(), lattice.cell_volume_m3());
        Traversal {
            index_limit: (1 << 20) - 4 * index_margin(lattice),
            cells_per_metre: 3.2 * reach * reach / volume,
            cells_at_ends: 4.2 * reach * reach * reach / volume + 8.0,
            lattice: lattice.clone(),
            kernel,
        }
    }

    /// Cell of a point, if rays can start and end there.
    pub(super) fn cell_of(&self, p_m: &Vector3<f64>) -> Result<Packed, Outside> {
        if !p_m.iter().all(|x| x.is_finite()) {
            return Err(Outside::NotFinite);
        }
        let cell = self.lattice.quantize(p_m).and_then(|w| self.in_range(w));
        cell.ok_or(Outside::OutOfRange)
    }

    /// The cell, if rays can start and end there: no cell of any ray has an index out of range.
    #[inline]
    pub(super) fn in_range(&self, w: LatticeIndex) -> Option<Packed> {
        let near = |i: i32| i.abs() < self.index_limit;
        (near(w[0]) & near(w[1]) & near(w[2])).then(|| Packed::new(w))?
    }

    /// Upper bound of the number of cells that a ray of this length touches.
    pub(super) fn most_steps(&self, length_m: f64) -> u64 {
        (self.cells_per_metre * length_m + self.cells_at_ends) as u64
    }
}

/// Upper bound of the difference between the index of a point's cell and the point's real-valued index.
fn index_margin(lattice: &Lattice) -> i32 {
    let Some(inverse) = lattice.generator().try_inverse() else {
        return 1 << 19;
    };
    let row = |i: usize| inverse.row(i).norm() * lattice.covering_radius_m();
    let most = (0..3).map(row).fold(0.0, f64::max);
    (most.ceil() + 1.0).min(f64::from(1 << 18)) as i32
}
