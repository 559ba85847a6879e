//! Parameters of a lattice in a file or a table.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion};

use crate::lattice::{Lattice, LatticeKind};

/// Maximum deviation of the squared length of a quaternion from 1.
const UNIT_SLACK: f64 = 1e-6;

/// Lattice as numbers that reproduce it exactly.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct LatticeFigures {
    /// Kind of the lattice.
    pub kind: LatticeKind,
    /// Volume of a cell, m^3.
    pub cell_volume_m3: f64,
    /// `map_from_lattice` as w, x, y, z.
    pub orientation: [f64; 4],
    /// Generator in the lattice frame, column after column, metres.
    pub generator_m: [f64; 9],
}

/// Inconsistent parameter.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{reason}")]
pub struct FiguresError {
    /// The parameter.
    pub figure: Figure,
    reason: String,
}

/// Parameter of a lattice.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[expect(missing_docs, reason = "named as the fields")]
pub enum Figure {
    Volume,
    Orientation,
    Generator,
}

impl Figure {
    fn error(self, reason: impl ToString) -> FiguresError {
        FiguresError {
            figure: self,
            reason: reason.to_string(),
        }
    }
}

impl From<&Lattice> for LatticeFigures {
    fn from(lattice: &Lattice) -> LatticeFigures {
        let q = lattice.orientation();
        let mut generator_m = [0.0; 9];
        let basis = lattice.unoriented_generator();
        for (to, from) in generator_m.iter_mut().zip(basis.as_slice()) {
            *to = *from;
        }
        LatticeFigures {
            kind: lattice.kind(),
            cell_volume_m3: lattice.cell_volume_m3(),
            orientation: [q.w, q.i, q.j, q.k],
            generator_m,
        }
    }
}

impl LatticeFigures {
    /// Kind of a name in a file, `custom` included.
    pub fn kind_of(name: &str) -> Result<LatticeKind, String> {
        if name == LatticeKind::Custom.name() {
            return Ok(LatticeKind::Custom);
        }
        name.parse().map_err(|error| format!("{error}"))
    }

    /// Lattice of these parameters, if it reproduces them to the bit.
    pub fn lattice(&self) -> Result<Lattice, FiguresError> {
        let (volume_m3, generator) = (self.cell_volume_m3, &self.generator_m);
        let lattice = match self.kind {
            LatticeKind::Custom => Lattice::from_basis(Matrix3::from_column_slice(generator))
                .map_err(|error| Figure::Generator.error(error))?,
            kind => Lattice::new(kind, volume_m3).map_err(|error| Figure::Volume.error(error))?,
        };
        let [w, x, y, z] = self.orientation;
        let rotation = UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z));
        if let Some(reason) = orientation_error(&rotation) {
            return Err(Figure::Orientation.error(reason));
        }
        let lattice = lattice.oriented(rotation);
        let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        let expected = LatticeFigures::from(&lattice);
        if volume_m3.to_bits() != expected.cell_volume_m3.to_bits() {
            let found = expected.cell_volume_m3;
            return Err(Figure::Volume.error(format!(
                "the cell volume is {volume_m3} m^3, that of the basis {found} m^3"
            )));
        }
        if bits(&self.orientation) != bits(&expected.orientation) {
            let (turned, expected) = (self.orientation, expected.orientation);
            return Err(Figure::Orientation.error(format!(
                "orientation {turned:?} differs from its canonical form {expected:?}"
            )));
        }
        if bits(generator) != bits(&expected.generator_m) {
            return Err(Figure::Generator.error(format!(
                "generator {generator:?} is not that of {lattice:?}"
            )));
        }
        Ok(lattice)
    }
}

/// Validates an orientation.
pub(super) fn orientation_error(map_from_lattice: &UnitQuaternion<f64>) -> Option<String> {
    let square = map_from_lattice.coords.norm_squared();
    // NaN fails too.
    let unit = (square - 1.0).abs() <= UNIT_SLACK;
    (!unit).then(|| {
        format!(
            "orientation {:?} is not a unit quaternion",
            map_from_lattice.coords
        )
    })
}
