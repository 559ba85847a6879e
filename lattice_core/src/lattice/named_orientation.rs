//! Named orientations of a lattice.

use std::fmt;

/// Named orientation of a lattice in the map, whose z axis is up.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Orientation {
    /// Axes of the paper, `paper`.
    #[default]
    Paper,
    /// Flattest cell: a shortest lattice vector up, `ground`.
    Ground,
    /// Crystal direction up, such as `110-up`; each entry is 0 or 1.
    ///
    /// The axes are those of the cube of cubic, BCC and FCC and of the cuboid of MCC, with the long side last. The
    /// other lattices have none.
    Up([u8; 3]),
}

impl fmt::Display for Orientation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Paper => f.pad("paper"),
            Self::Ground => f.pad("ground"),
            Self::Up([h, k, l]) => f.pad(&format!("{h}{k}{l}-up")),
        }
    }
}
