//! Errors of lattices.

use std::str::FromStr;

use thiserror::Error;

use super::kind::LatticeKind;
use super::named_orientation::Orientation;

/// Minimum cell volume, m^3: cell size 1 mm.
pub const MIN_CELL_VOLUME_M3: f64 = 1e-9;

/// Maximum cell volume, m^3: cell size 1 km.
pub const MAX_CELL_VOLUME_M3: f64 = 1e9;

/// Maximum covering radius of a custom lattice, in cell sizes (cube roots of the cell volume).
pub const MAX_COVERING_SIDES: f64 = 2.0;

/// Error in the definition of a lattice.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum LatticeError {
    /// Unknown lattice name.
    #[error("unknown lattice {0:?}: use one of cubic, bcc, fcc, mcc, hex, hexopt")]
    UnknownName(String),
    /// Cell volume out of range.
    #[error("cell volume {0} m^3 is not between {MIN_CELL_VOLUME_M3} and {MAX_CELL_VOLUME_M3} m^3")]
    CellVolume(f64),
    /// `Custom` without a basis.
    #[error("a custom lattice is made from its basis, with Lattice::from_basis")]
    NoBasis,
    /// Basis with an entry that is not finite.
    #[error("a basis vector is not finite")]
    NotFinite,
    /// Basis vectors too long for their lattice, or nearly coplanar.
    #[error("the basis is too skewed: {0}")]
    Skewed(String),
    /// Covering radius above [`MAX_COVERING_SIDES`].
    #[error(
        "cells are too long or flat: points up to {covering_radius_m} m from their lattice point, \
         allowed are {MAX_COVERING_SIDES} cell sides of {side_m} m"
    )]
    Elongated {
        /// Covering radius, metres.
        covering_radius_m: f64,
        /// Cell size (cube root of the cell volume), metres.
        side_m: f64,
    },
    /// Unknown orientation name.
    #[error("unknown orientation {0:?}: use paper, ground, or a crystal direction like 110-up")]
    UnknownOrientation(String),
    /// Lattice without that crystal direction.
    #[error("{1} has no direction for {0}: use paper or ground")]
    NoCrystalAxes(Orientation, LatticeKind),
}

impl FromStr for LatticeKind {
    type Err = LatticeError;

    fn from_str(name: &str) -> Result<Self, LatticeError> {
        Self::ALL
            .into_iter()
            .find(|kind| kind.name() == name)
            .ok_or_else(|| LatticeError::UnknownName(name.chars().take(40).collect()))
    }
}
