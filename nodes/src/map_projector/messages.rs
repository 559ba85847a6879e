//! Messages of a grid, and of elevation.

use lattice_core::navigation::{Cell, Elevation, Grid};
use lattice_msgs::geometry_msgs::Pose;
use lattice_msgs::grid_map_msgs::{GridMap, GridMapInfo};
use lattice_msgs::map_msgs::OccupancyGridUpdate;
use lattice_msgs::nav_msgs::{MapMetaData, OccupancyGrid};
use lattice_msgs::std_msgs::{Float32MultiArray, Header, MultiArrayDimension, MultiArrayLayout};

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

/// Layers as grid_map has them: column-major, with x along the rows and y along the columns, both from the greatest
/// coordinate down.
pub fn elevation_message(elevation: &Elevation, header: Header) -> GridMap {
    let (rows, columns) = (elevation.width, elevation.height);
    let [length_x, length_y] = [rows, columns].map(|count| count as f64 * elevation.resolution_m);
    let [x, y] = elevation
        .corner
        .map(|i| f64::from(i) * elevation.resolution_m);
    let mut pose = Pose::default();
    (pose.position.x, pose.position.y) = (x + 0.5 * length_x, y + 0.5 * length_y);
    pose.orientation.w = 1.0;
    let dimension = |label: &str, size: usize, stride: usize| MultiArrayDimension {
        label: label.to_owned(),
        size: size as u32,
        stride: stride as u32,
    };
    let array = |values: &[f32]| Float32MultiArray {
        layout: MultiArrayLayout {
            dim: vec![
                dimension("column_index", columns, rows * columns),
                dimension("row_index", rows, rows),
            ],
            data_offset: 0,
        },
        // Row by row from the lowest y, x fastest, is that order backwards.
        data: values.iter().rev().copied().collect(),
    };
    let layers = elevation.layers();
    GridMap {
        header,
        info: GridMapInfo {
            resolution: elevation.resolution_m,
            length_x,
            length_y,
            pose,
        },
        layers: layers.iter().map(|(name, _)| (*name).to_owned()).collect(),
        basic_layers: vec!["elevation".to_owned()],
        data: layers.iter().map(|(_, values)| array(values)).collect(),
        outer_start_index: 0,
        inner_start_index: 0,
    }
}
