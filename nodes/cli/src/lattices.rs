//! Lattices named on the command line.

use lattice_core::lattice::LatticeKind;

/// Lattices by name, those of the `paper`, or `all`.
#[derive(Clone, Debug)]
pub struct Lattices(pub Vec<LatticeKind>);

impl std::str::FromStr for Lattices {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "all" => return Ok(Self(LatticeKind::ALL.to_vec())),
            "paper" => return Ok(Self(LatticeKind::PAPER.to_vec())),
            _ => {}
        }
        let kinds = text.split(',').map(|name| {
            let kind = name.trim().parse::<LatticeKind>();
            kind.map_err(|e| format!("{e}; or 'all', or 'paper' for the five of the paper"))
        });
        kinds.collect::<Result<_, _>>().map(Self)
    }
}
