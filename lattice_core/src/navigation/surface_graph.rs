//! Standable surfaces as a graph.

use std::collections::VecDeque;

use nalgebra::Vector3;

use super::grid::Grid;
use super::surfaces::ColumnState;
use super::tiles::Tiles;
use super::{GroundOptions, ProjectionError};

/// Area below which a connected surface is no ground, m^2, unless there is no larger one: tables, crates, vehicles.
const MIN_GROUND_M2: f64 = 2.0;

/// Number of a component that a surface without one has.
const NONE: u32 = u32::MAX;

/// Standable surfaces as a graph.
#[derive(Clone, Debug)]
pub(super) struct SurfaceGraph {
    /// Rectangle of all columns, unknown.
    pub(super) grid: Grid,
    /// First node of each cell, and the number of nodes.
    first: Vec<u32>,
    /// Position of each node.
    pub(super) at_m: Vec<Vector3<f64>>,
    /// Component of each node.
    component: Vec<u32>,
    /// Nodes, and sum of their heights, of each component.
    sizes: Vec<(usize, f64)>,
}

/// Tests whether the robot drives from one surface to that of a neighbouring column.
pub(super) fn linked(a: &Vector3<f64>, b: &Vector3<f64>, ground: &GroundOptions) -> bool {
    (a.z - b.z).abs() <= ground.max_link_m((a.xy() - b.xy()).norm())
}

/// Steps to the cells that share an edge with a cell.
pub(super) const EDGES: [[i32; 2]; 4] = [[-1, 0], [1, 0], [0, -1], [0, 1]];
/// Steps to the cells that share a corner only.
pub(super) const CORNERS: [[i32; 2]; 4] = [[-1, -1], [1, -1], [-1, 1], [1, 1]];

/// Cell a step beside that of an index, if it is in the grid.
pub(super) fn beside(grid: &Grid, i: usize, [dx, dy]: [i32; 2]) -> Option<usize> {
    let width = grid.width.max(1);
    let x = (i % width).checked_add_signed(dx as isize)?;
    let y = (i / width).checked_add_signed(dy as isize)?;
    (x < grid.width && y < grid.height).then_some(y * width + x)
}

impl SurfaceGraph {
    pub(super) fn new(
        states: &Tiles<ColumnState>,
        resolution_m: f64,
        ground: &GroundOptions,
    ) -> Result<SurfaceGraph, ProjectionError> {
        let grid = Grid::around(states.iter().map(|(column, _)| column), resolution_m)?;
        let mut by_cell: Vec<Option<&ColumnState>> = vec![None; grid.cells.len()];
        for (column, state) in states.iter() {
            if let Some(cell) = grid.index(column).and_then(|i| by_cell.get_mut(i)) {
                *cell = Some(state);
            }
        }
        let (mut first, mut at_m) = (vec![0], Vec::new());
        for state in by_cell {
            let surfaces = state.map_or(&[][..], |state| &state.surfaces);
            let standable = surfaces.iter().filter(|surface| surface.is_standable);
            at_m.extend(standable.map(|surface| surface.at_m));
            first.push(u32::try_from(at_m.len()).unwrap_or(u32::MAX));
        }
        let mut graph = SurfaceGraph {
            grid,
            first,
            component: vec![NONE; at_m.len()],
            at_m,
            sizes: Vec::new(),
        };
        graph.connect(ground);
        Ok(graph)
    }

    pub(super) fn of_cell(&self, cell: usize) -> std::ops::Range<usize> {
        match self.first.get(cell..cell.saturating_add(2)) {
            Some([begin, end]) => *begin as usize..*end as usize,
            _ => 0..0,
        }
    }

    pub(super) fn component_of(&self, node: usize) -> u32 {
        self.component.get(node).copied().unwrap_or(NONE)
    }

    /// Numbers the connected components in the order of their first nodes.
    fn connect(&mut self, ground: &GroundOptions) {
        for cell in 0..self.grid.cells.len() {
            for node in self.of_cell(cell) {
                if self.component_of(node) == NONE {
                    self.flood(cell, node, ground);
                }
            }
        }
    }

    fn flood(&mut self, cell: usize, node: usize, ground: &GroundOptions) {
        let number = u32::try_from(self.sizes.len()).unwrap_or(NONE);
        let (mut count, mut sum_m) = (0, 0.0);
        let mut open = VecDeque::from([(cell, node)]);
        if let Some(component) = self.component.get_mut(node) {
            *component = number;
        }
        while let Some((cell, node)) = open.pop_front() {
            let Some(at_m) = self.at_m.get(node).copied() else {
                continue;
            };
            count += 1;
            sum_m += at_m.z;
            for cell in EDGES
                .into_iter()
                .filter_map(|step| beside(&self.grid, cell, step))
            {
                for node in self.of_cell(cell) {
                    let near = self
                        .at_m
                        .get(node)
                        .is_some_and(|b| linked(&at_m, b, ground));
                    if let Some(component) = self.component.get_mut(node)
                        && *component == NONE
                        && near
                    {
                        *component = number;
                        open.push_back((cell, node));
                    }
                }
            }
        }
        self.sizes.push((count, sum_m));
    }

    /// Components that are ground by their area.
    pub(super) fn is_ground(&self) -> impl Fn(u32) -> bool {
        let area_m2 = self.grid.resolution_m * self.grid.resolution_m;
        let is_large = move |count: usize| count as f64 * area_m2 >= MIN_GROUND_M2;
        let any_large = self.sizes.iter().any(|(count, _)| is_large(*count));
        move |number: u32| {
            let size = self.sizes.get(number as usize);
            size.is_some_and(|(count, _)| !any_large || is_large(*count))
        }
    }

    /// Component of the robot, and the height at which it is; the lowest without a robot.
    pub(super) fn start(
        &self,
        ground: &GroundOptions,
        robot_m: Option<Vector3<f64>>,
    ) -> Option<(u32, f64)> {
        let numbered = || (0..).zip(&self.sizes);
        let Some(robot_m) = robot_m else {
            let largest = self.sizes.iter().map(|(count, _)| *count).max()?;
            let large = numbered().filter(|(_, (count, _))| 2 * count >= largest);
            let height_m = |(count, sum_m): &(usize, f64)| sum_m / *count as f64;
            let lowest = large.min_by(|(_, a), (_, b)| height_m(a).total_cmp(&height_m(b)))?;
            return Some((lowest.0, f64::NEG_INFINITY));
        };
        let is_ground = self.is_ground();
        let below = self
            .component
            .iter()
            .zip(&self.at_m)
            .filter(|(component, at_m)| {
                at_m.z <= robot_m.z + ground.max_step_m && is_ground(**component)
            });
        let away = |at_m: &Vector3<f64>| (at_m - robot_m).norm_squared();
        let nearest = below.min_by(|(_, a), (_, b)| away(a).total_cmp(&away(b)));
        nearest.map(|(component, at_m)| (*component, at_m.z))
    }
}
