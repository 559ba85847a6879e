//! Names of the lattices.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::LatticeError;

/// The lattices of Ryde & Brünig 2011, section II-A.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LatticeKind {
    /// Simple cubic, eq. (8).
    Cubic,
    /// Body centred cubic, eq. (9): truncated octahedra.
    Bcc,
    /// Face centred cubic, eq. (10): rhombic dodecahedra.
    Fcc,
    /// Mean centred cuboidal, eq. (11).
    Mcc,
    /// Hexagonal prisms, eq. (12): flat cells, z up.
    Hex,
}

impl LatticeKind {
    /// Every lattice, in the order of the paper.
    pub const ALL: [LatticeKind; 5] = [Self::Cubic, Self::Bcc, Self::Fcc, Self::Mcc, Self::Hex];

    /// The name used in parameters, messages and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cubic => "cubic",
            Self::Bcc => "bcc",
            Self::Fcc => "fcc",
            Self::Mcc => "mcc",
            Self::Hex => "hex",
        }
    }
}

impl fmt::Display for LatticeKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
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
    fn an_unknown_name_is_told_the_known_ones() {
        let error = "BCC ".parse::<LatticeKind>().unwrap_err().to_string();
        assert!(error.contains("\"BCC \"") && error.contains("cubic, bcc, fcc, mcc, hex"));
    }
}
