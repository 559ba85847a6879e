//! Messages of a grid.

use lattice_core::navigation::{Cell, Grid};
use lattice_msgs::geometry_msgs::Pose;
use lattice_msgs::map_msgs::OccupancyGridUpdate;
use lattice_msgs::nav_msgs::{MapMetaData, OccupancyGrid};
use lattice_msgs::std_msgs::Header;

use super::changes::Part;

/// Probability of occupancy of a cell, percent; -1 if unknown.
pub fn percent(cell: Cell) -> i8 {
    match cell {
        Cell::Unknown => -1,
        Cell::Free => 0,
        Cell::Occupied => 100,
    }
}

/// A whole grid.
pub fn grid_message(grid: &Grid, header: Header) -> OccupancyGrid {
    let [x, y] = grid.origin_m();
    let mut origin = Pose::default();
    (origin.position.x, origin.position.y, origin.orientation.w) = (x, y, 1.0);
    OccupancyGrid {
        info: MapMetaData {
            map_load_time: header.stamp,
            resolution: grid.resolution_m as f32,
            width: grid.width as u32,
            height: grid.height as u32,
            origin,
        },
        header,
        data: grid.cells.iter().map(|cell| percent(*cell)).collect(),
    }
}

/// A part of a grid.
pub(super) fn update(grid: &Grid, part: &Part, header: Header) -> OccupancyGridUpdate {
    let rows = part.rows(grid).filter_map(|row| grid.cells.get(row));
    OccupancyGridUpdate {
        header,
        x: part.x as i32,
        y: part.y as i32,
        width: part.width as u32,
        height: part.height as u32,
        data: rows.flatten().map(|cell| percent(*cell)).collect(),
    }
}
