//! Steps over the surface graph, and straight lines of them.

use std::cmp::Ordering;

use nalgebra::Vector3;

use super::options::GroundOptions;
use super::surface_graph::{SurfaceGraph, beside, linked};

/// Surface of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Place {
    /// Cell of the grid.
    pub(super) cell: u32,
    /// Node of the graph.
    pub(super) node: u32,
}

impl Place {
    pub(super) fn new(cell: usize, node: usize) -> Option<Place> {
        Some(Place {
            cell: u32::try_from(cell).ok()?,
            node: u32::try_from(node).ok()?,
        })
    }
}

/// Surface graph of a robot, on which steps are taken.
#[derive(Clone, Copy)]
pub(super) struct Steps<'a> {
    pub(super) graph: &'a SurfaceGraph,
    pub(super) ground: &'a GroundOptions,
    /// Nodes that steps may lead to; empty: all.
    pub(super) open: &'a [bool],
}

impl Steps<'_> {
    fn is_open(&self, place: &Place) -> bool {
        self.open.is_empty() || self.open.get(place.node as usize) == Some(&true)
    }

    /// Column of a cell, counted from that of the first cell.
    pub(super) fn column(&self, place: Place) -> [i32; 2] {
        let width = self.graph.grid.width.max(1);
        let cell = place.cell as usize;
        [(cell % width) as i32, (cell / width) as i32]
    }

    /// Centre of the cell at the height of its surface, map frame, metres.
    pub(super) fn point_m(&self, place: Place) -> Vector3<f64> {
        let height_m = self.graph.at_m.get(place.node as usize);
        let grid = &self.graph.grid;
        let [x, y] = self.column(place);
        let at_m =
            |i: i32, corner: i32| (f64::from(corner) + f64::from(i) + 0.5) * grid.resolution_m;
        Vector3::new(
            at_m(x, grid.corner[0]),
            at_m(y, grid.corner[1]),
            height_m.map_or(0.0, |at_m| at_m.z),
        )
    }

    /// Surface of a cell beside that is linked, the nearest in height.
    pub(super) fn edge(&self, from: Place, step: [i32; 2]) -> Option<Place> {
        let at_m = |node: usize| self.graph.at_m.get(node);
        let from_m = at_m(from.node as usize)?;
        let cell = beside(&self.graph.grid, from.cell as usize, step)?;
        let near = self.graph.of_cell(cell).filter_map(|node| {
            let to_m = at_m(node).filter(|to_m| linked(from_m, to_m, self.ground))?;
            Some((node, (to_m.z - from_m.z).abs()))
        });
        let (node, _) = near.min_by(|(_, a), (_, b)| a.total_cmp(b))?;
        Place::new(cell, node).filter(|place| self.is_open(place))
    }

    /// Surface of a cell that shares a corner only, over both of the cells between.
    pub(super) fn corner(&self, from: Place, [dx, dy]: [i32; 2]) -> Option<Place> {
        let by_x = self.edge(self.edge(from, [dx, 0])?, [0, dy])?;
        let by_y = self.edge(self.edge(from, [0, dy])?, [dx, 0])?;
        (by_x == by_y).then_some(by_x)
    }

    /// Surfaces of all cells that the line between the centres of two cells touches, the first one left out; `None` if
    /// one of them has no open surface that is linked, or the line ends on another surface.
    pub(super) fn line(&self, from: Place, to: Place) -> Option<Vec<Place>> {
        let ([x0, y0], [x1, y1]) = (self.column(from), self.column(to));
        let (sx, sy) = ((x1 - x0).signum(), (y1 - y0).signum());
        let [nx, ny] = [x1 - x0, y1 - y0].map(|n| i64::from(n.unsigned_abs()));
        let (mut x, mut y, mut at) = (0, 0, from);
        let mut line = Vec::with_capacity((nx + ny) as usize);
        while x < nx || y < ny {
            // Borders of the columns and rows that come next, along the line.
            match ((1 + 2 * x) * ny).cmp(&((1 + 2 * y) * nx)) {
                Ordering::Less => {
                    at = self.edge(at, [sx, 0])?;
                    x += 1;
                }
                Ordering::Greater => {
                    at = self.edge(at, [0, sy])?;
                    y += 1;
                }
                Ordering::Equal => {
                    at = self.corner(at, [sx, sy])?;
                    (x, y) = (x + 1, y + 1);
                }
            }
            line.push(at);
        }
        (at == to).then_some(line)
    }
}
