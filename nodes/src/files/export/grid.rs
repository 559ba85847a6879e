//! Occupancy grids as Nav2's map_server reads them: a PGM image and a YAML file.

use std::io::Write;

use lattice_core::navigation::{Cell, Grid};

use super::error::ExportError;

/// Grey value of a cell in the mode trinary.
fn grey(cell: Cell) -> u8 {
    match cell {
        Cell::Occupied => 0,
        Cell::Unknown => 205,
        Cell::Free => 254,
    }
}

/// Writes the image: the first row is that of the greatest y.
pub fn write_grid_pgm(grid: &Grid, out: &mut impl Write) -> Result<(), ExportError> {
    write!(out, "P5\n{} {}\n255\n", grid.width, grid.height)?;
    for row in grid.cells.chunks(grid.width.max(1)).rev() {
        let row: Vec<u8> = row.iter().map(|cell| grey(*cell)).collect();
        out.write_all(&row)?;
    }
    Ok(())
}

/// Writes the file that names the image and has its place in the map frame.
///
/// With the usual `free_thresh` of 0.25 the grey value of unknown cells, 0.196, would be that of free ones.
pub fn write_grid_yaml(grid: &Grid, image: &str, out: &mut impl Write) -> Result<(), ExportError> {
    let [x_m, y_m] = grid.origin_m();
    // A file name may hold anything: between quotes a quote is doubled.
    let image = image.replace('\'', "''");
    writeln!(out, "image: '{image}'\nmode: trinary")?;
    writeln!(
        out,
        "resolution: {}\norigin: [{x_m:?}, {y_m:?}, 0.0]",
        grid.resolution_m as f32
    )?;
    writeln!(out, "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196")?;
    Ok(())
}
