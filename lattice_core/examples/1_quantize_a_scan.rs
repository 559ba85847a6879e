//! Quantizes points to lattices of equal cell volume and compares their errors.
//!
//! `cargo run --release -p lattice_core --example 1_quantize_a_scan`

use std::error::Error;

use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::nalgebra::Vector3;

/// Edge of the cube of equal volume, metres.
const CELL_SIZE_M: f64 = 0.2;
const POINTS: u32 = 100_000;

/// Points that fill a hall of 20 m x 20 m x 4 m evenly.
fn scan() -> impl Iterator<Item = Vector3<f64>> {
    let fraction = |i: u32, step: f64| (f64::from(i) * step).fract();
    (0..POINTS).map(move |i| {
        let (x, y) = (fraction(i, 0.819_172_5), fraction(i, 0.671_043_6));
        Vector3::new(20.0 * x, 20.0 * y, 4.0 * fraction(i, 0.549_700_5))
    })
}

/// Mean squared distance of points from their lattice points, for each dimension, m^2.
fn error_m2(lattice: &Lattice) -> Result<f64, Box<dyn Error>> {
    let mut sum_m2 = 0.0;
    for point in scan() {
        let cell = lattice.quantize(&point).ok_or("a point has no cell")?;
        sum_m2 += (point - lattice.center(cell)).norm_squared();
    }
    Ok(sum_m2 / f64::from(3 * POINTS))
}

fn main() -> Result<(), Box<dyn Error>> {
    let volume_m3 = CELL_SIZE_M.powi(3);
    let cubic_m2 = error_m2(&Lattice::new(LatticeKind::Cubic, volume_m3)?)?;
    for kind in LatticeKind::PAPER {
        let lattice = Lattice::new(kind, volume_m3)?;
        let relative = error_m2(&lattice)? / cubic_m2;
        let faces = lattice.cell().faces.len();
        println!("{kind:>5}: {faces:2} faces, squared error {relative:.4} of that of cubes");
        if kind == LatticeKind::Fcc {
            // 0.0787 and 1/12 are the normalized second moments of the two cells.
            assert!((relative - 0.945).abs() < 0.003, "{relative}");
        }
    }
    Ok(())
}
