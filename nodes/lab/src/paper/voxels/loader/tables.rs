//! The tables beside Table I.

use super::placed::{POINTS, Placed, Printed, VOLUME_M3, find, rms_m};
use crate::evaluate::extent;
use crate::report::plot::title;
use crate::report::{Cell, Table};
use crate::theory::mean_distance_m;
use lattice_core::lattice::LatticeKind;
use lattice_nodes::replay::RunReport;
use std::path::Path;

/// Table I as printed and as simulated.
pub fn compared(all: &[Placed]) -> Table {
    let columns = "lattice|voxels, printed|voxels|±|least|most|to cubic, printed (%)|to cubic (%)|\
        MSE/dim, printed (m²)|MSE/dim (m²)|mean distance (m)|RMS, printed (m)|RMS (m)|least|\
        most";
    let cubic = |of: fn(&Placed) -> f64| find(all, LatticeKind::Cubic).map_or(f64::NAN, of);
    let cubic_printed = cubic(|placed| placed.printed.map_or(f64::NAN, |row| row.voxels));
    let cubic_voxels = cubic(|placed| placed.voxels().mean);
    let row = |placed: &Placed| {
        let of_paper =
            |of: fn(&Printed) -> f64, digits| Cell::number(placed.printed.as_ref().map(of), digits);
        let voxels = placed.voxels();
        let [least, most] = extent(placed.each(|q| q.voxels as f64));
        let [low, high] = extent(placed.each(rms_m));
        let to_cubic = |row: Printed| 100.0 * (row.voxels / cubic_printed - 1.0);
        vec![
            placed.name().into(),
            of_paper(|row| row.voxels, 0),
            Cell::Number(voxels.mean, 1),
            Cell::Number(voxels.half, 1),
            Cell::Number(least, 0),
            Cell::Number(most, 0),
            Cell::number(placed.printed.map(to_cubic), 1),
            Cell::Number(100.0 * (voxels.mean / cubic_voxels - 1.0), 1),
            of_paper(|row| row.mse, 4),
            Cell::Number(placed.mean(|q| q.mse_m2).mean, 6),
            Cell::Number(placed.mean(|q| q.mean_m).mean, 5),
            of_paper(|row| row.distance_error, 4),
            Cell::Number((3.0 * placed.mean(|q| q.mse_m2).mean).sqrt(), 5),
            Cell::Number(low, 4),
            Cell::Number(high, 4),
        ]
    };
    Table::new(
        "table1",
        format!(
            "Table I as printed and {POINTS} points of a simulated loader's log in cells of {VOLUME_M3} m³: mean over all \
             places of the lattice with 95 % interval, least and most of any place"
        ),
        columns,
        all.iter().map(row),
    )
}

/// Table I as printed and as theory has it.
pub fn theory(all: &[Placed]) -> Table {
    let columns = "lattice|theory: MSE/dim (m²)|theory: mean distance (m)|theory: RMS (m)|\
        printed MSE/dim (m²)|to theory (%)|√(3 printed MSE) (m)|printed \"distance error\" (m)";
    let row = |placed: &Placed| {
        let mse = placed.mse_of_theory();
        let printed =
            |of: &dyn Fn(Printed) -> f64, digits| Cell::number(placed.printed.map(of), digits);
        vec![
            placed.name().into(),
            Cell::Number(mse, 6),
            Cell::Number(mean_distance_m(&placed.lattice, [0; 3]), 5),
            Cell::Number((3.0 * mse).sqrt(), 5),
            printed(&|row| row.mse, 4),
            printed(&|row| 100.0 * (row.mse / mse - 1.0), 1),
            printed(&|row| (3.0 * row.mse).sqrt(), 4),
            printed(&|row| row.distance_error, 4),
        ]
    };
    Table::new(
        "table1_theory",
        format!("Table I against theory for evenly spread points, cells of {VOLUME_M3} m³"),
        columns,
        all.iter().map(row),
    )
}

/// A log that was given.
pub fn of_log(run: &RunReport, path: &Path, number: usize) -> Table {
    let columns = "lattice|points|voxels|to cubic (%)|MSE/dim (m²)|mean distance (m)|RMS (m)|\
        largest distance (m)";
    let cubic = run.lattices.first();
    let cubic = cubic.map_or(f64::NAN, |l| l.map.voxels as f64);
    let lattices = LatticeKind::ALL.into_iter().zip(&run.lattices);
    let rows = lattices.map(|(kind, lattice)| {
        let map = &lattice.map;
        vec![
            title(kind).into(),
            Cell::Count(map.points),
            map.voxels.into(),
            Cell::Number(100.0 * (map.voxels as f64 / cubic - 1.0), 2),
            Cell::Number(map.mse_per_dimension_m2, 6),
            Cell::Number(map.mean_distance_m, 5),
            Cell::Number(map.rms_m, 5),
            Cell::Number(map.max_distance_m, 4),
        ]
    });
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    Table::new(
        format!("table1_log{}", number + 1),
        format!("The log {name} in cells of {VOLUME_M3} m³"),
        columns,
        rows,
    )
}
