//! Kinds of lattices and their names.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Kind of a lattice: those of Ryde & Brünig 2011, section II-A, the optimal prisms, and custom ones.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LatticeKind {
    /// Simple cubic, eq. (8).
    Cubic,
    /// Body-centred cubic, eq. (9): truncated octahedra.
    Bcc,
    /// Face-centred cubic, eq. (10): rhombic dodecahedra.
    Fcc,
    /// Mean-centred cuboidal, eq. (11).
    Mcc,
    /// Hexagonal prisms, eq. (12): flat cells, z up.
    Hex,
    /// Hexagonal prisms of minimal mean squared error, slightly taller than those of the paper.
    #[serde(rename = "hexopt")]
    HexOptimal,
    /// Basis given to [`super::Lattice::from_basis`].
    Custom,
}

impl LatticeKind {
    /// Lattices of the paper, in its order.
    pub const PAPER: [LatticeKind; 5] = [Self::Cubic, Self::Bcc, Self::Fcc, Self::Mcc, Self::Hex];

    /// All lattices defined by a name and a cell volume: those of the paper, then `hexopt`.
    pub const ALL: [LatticeKind; 6] = [
        Self::Cubic,
        Self::Bcc,
        Self::Fcc,
        Self::Mcc,
        Self::Hex,
        Self::HexOptimal,
    ];

    /// Name in parameters, messages and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cubic => "cubic",
            Self::Bcc => "bcc",
            Self::Fcc => "fcc",
            Self::Mcc => "mcc",
            Self::Hex => "hex",
            Self::HexOptimal => "hexopt",
            Self::Custom => "custom",
        }
    }
}

impl fmt::Display for LatticeKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip() {
        for kind in LatticeKind::ALL {
            assert_eq!(kind.to_string().parse::<LatticeKind>(), Ok(kind));
        }
    }

    #[test]
    fn those_of_the_paper_come_first() {
        assert!(LatticeKind::ALL.starts_with(&LatticeKind::PAPER));
    }

    #[test]
    fn a_custom_lattice_has_no_name_to_ask_for() {
        assert!("custom".parse::<LatticeKind>().is_err());
    }

    #[test]
    fn the_error_of_an_unknown_name_lists_the_known_ones() {
        let error = "BCC ".parse::<LatticeKind>().unwrap_err().to_string();
        assert!(error.contains("\"BCC \"") && error.contains("cubic, bcc, fcc, mcc, hex"));
    }
}
