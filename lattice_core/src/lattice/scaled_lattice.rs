//! A lattice with cell volume and orientation.

use std::fmt;
use std::sync::Arc;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::basis::Basis;
use super::closed_form::ClosedForm;
use super::error::{LatticeError, MAX_CELL_VOLUME_M3, MAX_COVERING_SIDES, MIN_CELL_VOLUME_M3};
use super::index::{LatticeIndex, center, combine};
use super::kind::LatticeKind;
use super::named_orientation::Orientation;
use super::orientation::upright;
use super::quantizer::{Quantizer, with_form};
use super::shape::Shape;
use super::voronoi::VoronoiCell;

/// Bound of the indices of [`Lattice::quantize`].
const INDEX_LIMIT: u64 = 1 << 20;

/// Lattice of one kind, cell volume and orientation; cheap to clone.
///
/// ```
/// use lattice_core::lattice::{Lattice, LatticeKind};
/// use lattice_core::nalgebra::Vector3;
///
/// let lattice = Lattice::new(LatticeKind::Fcc, 0.125)?;
/// let point_m = Vector3::new(1.2, -0.4, 3.1);
/// let cell = lattice.quantize(&point_m).expect("the point is finite and near");
/// let apart_m = (point_m - lattice.center(cell)).norm();
/// assert!(apart_m <= lattice.covering_radius_m());
/// # Ok::<(), lattice_core::lattice::LatticeError>(())
/// ```
#[derive(Clone)]
pub struct Lattice {
    quantizer: Quantizer,
    /// Shape in the axes of the map.
    generator: Matrix3<f64>,
    /// Rows that rotate a point to the axes of the quantizer, if these differ from the map's.
    lattice_from_map: Option<[[f64; 3]; 3]>,
    shape: Arc<Shape>,
}

/// Equal if every index denotes the same point, to the bit.
impl Lattice {
    /// Creates a lattice with cells of `cell_volume_m3`, oriented as in the paper.
    ///
    /// Fails outside [`MIN_CELL_VOLUME_M3`] to [`MAX_CELL_VOLUME_M3`], and for `Custom`.
    pub fn new(kind: LatticeKind, cell_volume_m3: f64) -> Result<Lattice, LatticeError> {
        check_volume(cell_volume_m3)?;
        let generator =
            super::generator::unit_generator(kind) * super::generator::cube_root(cell_volume_m3);
        let quantizer = Quantizer::new(kind, &generator).ok_or(LatticeError::NoBasis)?;
        let (faces, touching) = (
            super::neighbors::faces(kind),
            super::neighbors::touching(kind),
        );
        let shape = Shape::new(kind, cell_volume_m3, generator, faces, touching);
        Ok(Self::unoriented(quantizer, shape))
    }

    /// Creates the lattice of the basis vectors in the columns of `generator_m`, metres; indices refer to them. Its
    /// kind is `Custom`.
    ///
    /// Fails if a number is not finite, if the volume is out of range as for [`Lattice::new`], if the vectors are
    /// nearly coplanar or far longer than needed, or if the cells are too elongated or flat ([`MAX_COVERING_SIDES`]).
    pub fn from_basis(generator_m: Matrix3<f64>) -> Result<Lattice, LatticeError> {
        if generator_m.iter().any(|entry| !entry.is_finite()) {
            return Err(LatticeError::NotFinite);
        }
        let cell_volume_m3 = generator_m.determinant().abs();
        check_volume(cell_volume_m3)?;
        let basis = Basis::new(&generator_m)?;
        let (faces, others) = basis.neighbors();
        let touching = [faces.as_slice(), &others].concat();
        let kind = LatticeKind::Custom;
        let shape = Shape::new(kind, cell_volume_m3, generator_m, &faces, &touching);
        let side_m = super::generator::cube_root(cell_volume_m3);
        let covering_radius_m = shape.covering_radius_m;
        if covering_radius_m > MAX_COVERING_SIDES * side_m {
            return Err(LatticeError::Elongated {
                covering_radius_m,
                side_m,
            });
        }
        Ok(Self::unoriented(Quantizer::Basis(Arc::new(basis)), shape))
    }

    fn unoriented(quantizer: Quantizer, shape: Shape) -> Lattice {
        Lattice {
            quantizer,
            generator: shape.generator,
            lattice_from_map: None,
            shape: Arc::new(shape),
        }
    }

    /// Rotates the lattice about 0, so that its own axes have the orientation `map_from_lattice` in the map.
    ///
    /// Replaces an earlier orientation; the identity changes no bit. With a rotation that is not finite, no point has
    /// a cell.
    #[must_use]
    pub fn oriented(self, map_from_lattice: UnitQuaternion<f64>) -> Lattice {
        let rotation = super::orientation::canonical(map_from_lattice);
        if rotation == self.shape.map_from_lattice {
            return self;
        }
        let shape = self.shape.oriented(rotation);
        if rotation == UnitQuaternion::identity() {
            return Self::unoriented(self.quantizer, shape);
        }
        let matrix = super::orientation::matrix(&rotation);
        let column = |i| [matrix[(0, i)], matrix[(1, i)], matrix[(2, i)]];
        Lattice {
            quantizer: self.quantizer,
            generator: matrix * shape.generator,
            lattice_from_map: Some([column(0), column(1), column(2)]),
            shape: Arc::new(shape),
        }
    }

    /// Scales all lengths by `factor`; kind, orientation and indices stay.
    ///
    /// A power of two scales every vector exactly. Fails if the cell volume is out of range as for [`Lattice::new`].
    pub fn scaled(&self, factor: f64) -> Result<Lattice, LatticeError> {
        let cell_volume_m3 = self.cell_volume_m3() * (factor * factor * factor);
        check_volume(cell_volume_m3)?;
        let lattice = match self.kind() {
            LatticeKind::Custom => Lattice::from_basis(self.unoriented_generator() * factor)?,
            kind => Lattice::new(kind, cell_volume_m3)?,
        };
        Ok(lattice.oriented(self.orientation()))
    }

    /// Rotation from the lattice's own axes to those of the map, as the quaternion with a positive real part.
    pub fn orientation(&self) -> UnitQuaternion<f64> {
        self.shape.map_from_lattice
    }

    /// Kind of the lattice.
    pub fn kind(&self) -> LatticeKind {
        self.shape.kind
    }

    /// Volume of a cell, m^3.
    pub fn cell_volume_m3(&self) -> f64 {
        self.shape.cell_volume_m3
    }

    /// Cell size: edge of the cube of equal volume, metres.
    pub fn cell_side_m(&self) -> f64 {
        super::generator::cube_root(self.cell_volume_m3())
    }

    /// Generator in the axes of the map: columns are the basis vectors, metres.
    pub fn generator(&self) -> Matrix3<f64> {
        self.generator
    }

    /// Generator `G` in the lattice's own axes, as in the paper or as given, metres.
    pub fn unoriented_generator(&self) -> Matrix3<f64> {
        self.shape.generator
    }

    #[inline(always)]
    fn nearest(&self, p: [f64; 3]) -> Option<[i64; 3]> {
        let p = match &self.lattice_from_map {
            None => p,
            Some(rows) => turn(rows, p),
        };
        with_form!(&self.quantizer, form => form.nearest(p))
    }

    /// Quantizes a point: the exact nearest lattice point to `p` (metres), eq. (2) in closed form.
    ///
    /// `None` if `p` is not finite or an index reaches 2^20 in magnitude. On a border between cells the result is one
    /// of them, the same on every machine.
    #[inline]
    pub fn quantize(&self, p: &Vector3<f64>) -> Option<LatticeIndex> {
        self.nearest([p.x, p.y, p.z]).and_then(narrow)
    }

    /// [`Lattice::quantize`] for many points (metres): calls `visit` with each point and its result.
    #[inline]
    pub fn quantize_each(
        &self,
        points_m: impl IntoIterator<Item = [f64; 3]>,
        mut visit: impl FnMut([f64; 3], Option<LatticeIndex>),
    ) {
        if let Some(rows) = &self.lattice_from_map {
            return with_form!(&self.quantizer, form => {
                for p in points_m {
                    visit(p, form.nearest(turn(rows, p)).and_then(narrow));
                }
            });
        }
        with_form!(&self.quantizer, form => {
            for p in points_m {
                visit(p, form.nearest(p).and_then(narrow));
            }
        })
    }

    /// [`Lattice::quantize`] with 64-bit indices, up to 2^48 cells from 0.
    pub fn quantize_wide(&self, p: &Vector3<f64>) -> Option<[i64; 3]> {
        self.nearest([p.x, p.y, p.z])
    }

    /// Lattice point `G w`, metres.
    #[inline]
    pub fn center(&self, w: LatticeIndex) -> Vector3<f64> {
        center(&self.generator, w)
    }

    /// [`Lattice::center`] for 64-bit indices; exact to the rounding of f64.
    pub fn center_wide(&self, w: [i64; 3]) -> Vector3<f64> {
        combine(&self.generator, w.map(|i| i as f64))
    }

    /// Index differences to the face neighbours.
    pub fn face_neighbors(&self) -> &[LatticeIndex] {
        self.shape.face_neighbors()
    }

    /// Index differences to all touching cells (sharing a face, an edge or a vertex); face neighbours first.
    pub fn touching_neighbors(&self) -> &[LatticeIndex] {
        &self.shape.touching
    }

    /// Voronoi cell of lattice point 0, in the axes of the map.
    pub fn cell(&self) -> &VoronoiCell {
        &self.shape.cell
    }

    /// Covering radius: maximum distance of any point from its lattice point, metres.
    pub fn covering_radius_m(&self) -> f64 {
        self.shape.covering_radius_m
    }

    /// Inradius: minimum distance of the cell's surface from its lattice point, metres.
    pub fn packing_radius_m(&self) -> f64 {
        self.shape.packing_radius_m
    }

    /// Rotates the lattice to a named orientation; see [`Orientation`].
    pub fn with_orientation(self, orientation: Orientation) -> Result<Lattice, LatticeError> {
        let rotation = match (self.kind(), orientation) {
            (LatticeKind::Custom, Orientation::Ground) => {
                let vectors = self.face_neighbors().iter();
                let basis = self.unoriented_generator();
                let vectors = vectors.map(|w| basis * Vector3::from(w.map(f64::from)));
                let shortest = vectors.min_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()));
                shortest.map_or_else(UnitQuaternion::identity, upright)
            }
            (kind, _) => orientation.map_from_lattice(kind)?,
        };
        Ok(self.oriented(rotation))
    }
}

impl PartialEq for Lattice {
    fn eq(&self, other: &Lattice) -> bool {
        let (a, b) = (&self.shape, &other.shape);
        a.kind == b.kind
            && a.cell_volume_m3 == b.cell_volume_m3
            && a.generator == b.generator
            && a.map_from_lattice == b.map_from_lattice
    }
}

impl fmt::Debug for Lattice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Lattice({}, {} m^3", self.kind(), self.cell_volume_m3())?;
        if self.lattice_from_map.is_some() {
            write!(f, ", turned by {:?}", self.orientation().coords)?;
        }
        f.write_str(")")
    }
}

fn check_volume(cell_volume_m3: f64) -> Result<(), LatticeError> {
    if (MIN_CELL_VOLUME_M3..=MAX_CELL_VOLUME_M3).contains(&cell_volume_m3) {
        Ok(())
    } else {
        Err(LatticeError::CellVolume(cell_volume_m3))
    }
}

#[inline(always)]
fn turn(rows: &[[f64; 3]; 3], p: [f64; 3]) -> [f64; 3] {
    rows.map(|row| row[0] * p[0] + row[1] * p[1] + row[2] * p[2])
}

#[inline(always)]
fn narrow(w: [i64; 3]) -> Option<LatticeIndex> {
    let fits = |i: i64| i.unsigned_abs() < INDEX_LIMIT;
    (fits(w[0]) & fits(w[1]) & fits(w[2])).then(|| w.map(|i| i as i32))
}
