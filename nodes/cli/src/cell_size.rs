//! Cell size options.

use clap::Args;
use lattice_nodes::lattice_mapper::cube_m3;

/// Smallest and largest cell size, m; the lattice has the same bounds as volumes.
const BOUNDS_M: std::ops::RangeInclusive<f64> = 1e-3..=1e3;

/// Cell size, by one of two options.
#[derive(Args, Clone, Copy, Debug, Default)]
pub struct CellSize {
    /// Edge of the cube with the volume of one cell, m; default 0.5 (--cell-volume 0.125), unless set by a
    /// parameter
    #[arg(long, value_name = "M", value_parser = size)]
    pub cell_size: Option<f64>,
    /// Volume of one cell, m^3
    #[arg(long, value_name = "M3", conflicts_with = "cell_size")]
    pub cell_volume: Option<f64>,
}

impl CellSize {
    /// Requested volume, m^3.
    pub fn volume_m3(&self) -> Option<f64> {
        self.cell_volume.or(self.cell_size.map(cube_m3))
    }

    /// Fails with a reason if a size is given where the cells are fixed.
    #[cfg(feature = "viewer")]
    pub fn expect_none(&self, why: &str) -> Result<(), String> {
        let option = match (self.cell_size, self.cell_volume) {
            (Some(_), _) => "--cell-size",
            (None, Some(_)) => "--cell-volume",
            (None, None) => return Ok(()),
        };
        Err(format!("{option} has no effect here: {why}"))
    }
}

/// Typed cell size.
pub fn size(text: &str) -> Result<f64, String> {
    let size_m: Option<f64> = text.parse().ok();
    let is_allowed = |size_m: &f64| BOUNDS_M.contains(size_m);
    let bounds = || {
        let (least, most) = (BOUNDS_M.start(), BOUNDS_M.end());
        format!("expected {least} to {most} m")
    };
    size_m.filter(is_allowed).ok_or_else(bounds)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_edges_of_cubes_within_bounds() {
        let cells = CellSize {
            cell_size: Some(size("0.5").unwrap()),
            cell_volume: None,
        };
        assert_eq!(cells.volume_m3(), Some(0.125));
        assert_eq!(CellSize::default().volume_m3(), None);
        for text in ["0", "-0.2", "nan", "inf", "1001", "0.2m", ""] {
            assert_eq!(size(text).unwrap_err(), "expected 0.001 to 1000 m");
        }
        for text in ["0.001", "1000"] {
            let volume_m3 = cube_m3(size(text).unwrap());
            let kind = lattice_core::lattice::LatticeKind::Fcc;
            lattice_core::lattice::Lattice::new(kind, volume_m3).unwrap();
        }
    }
}
