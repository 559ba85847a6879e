//! Surfaces of the start and the goal of a path.

use nalgebra::Vector3;

use super::ground_path_error::{GroundPathError, PathEnd};
use super::surface_graph::SurfaceGraph;
use super::surface_steps::{Place, Steps};

/// Maximum radius and tolerance, cells: bounds the work for a cell without ground.
const MAX_CELLS: f64 = 50.0;

/// Checks lengths of the options against the cells.
pub(super) fn checked(
    graph: &SurfaceGraph,
    robot_radius_m: f64,
    tolerance_m: f64,
) -> Result<(), GroundPathError> {
    let resolution_m = graph.grid.resolution_m;
    let max = MAX_CELLS * resolution_m;
    let lengths = [
        ("robot_radius_m", robot_radius_m),
        ("plan_tolerance_m", tolerance_m),
    ];
    let outside = lengths
        .into_iter()
        .find(|(_, value)| !(0.0..=max).contains(value));
    outside.map_or(Ok(()), |(name, value)| {
        Err(GroundPathError::Length {
            name,
            value,
            max,
            resolution_m,
        })
    })
}

/// Ground near an end.
#[derive(Clone, Copy)]
struct Candidate {
    at: Place,
    z_m: f64,
    /// Horizontal distance from the end, metres; 0 in its cell.
    away_m: f64,
}

/// Search for the places of the ends.
pub(super) struct EndSearch<'a> {
    pub(super) steps: Steps<'a>,
    pub(super) radius_m: f64,
    pub(super) tolerance_m: f64,
}

impl EndSearch<'_> {
    /// Finds the open place nearest to an end, on the sheet of ground below it; on a component, if there is one.
    pub(super) fn find(
        &self,
        end: PathEnd,
        end_m: &Vector3<f64>,
        component: Option<u32>,
    ) -> Result<Place, GroundPathError> {
        let (at_m, tolerance_m) = ((*end_m).into(), self.tolerance_m);
        let candidates = self.candidates(end_m);
        let candidates = candidates.ok_or(GroundPathError::Outside { end, at_m })?;
        let step_m = self.steps.ground.max_step_m;
        let below_m = |candidate: &Candidate| end_m.z + step_m - candidate.z_m;
        // Ground below first, then that above; the nearest in height.
        let rank = |candidate: &Candidate| (below_m(candidate) < 0.0, below_m(candidate).abs());
        let nearest = candidates.iter().min_by(|a, b| {
            let (a, b) = (rank(a), rank(b));
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
        });
        let nearest = nearest.ok_or(GroundPathError::NoGround {
            end,
            at_m,
            tolerance_m,
        })?;
        let rise_m = self.steps.ground.max_link_m(2.0 * tolerance_m);
        let sheet_m = rise_m.min(self.steps.ground.robot_height_m);
        let on_sheet = |candidate: &&Candidate| (candidate.z_m - nearest.z_m).abs() <= sheet_m;
        let is_open =
            |candidate: &&Candidate| self.steps.open.get(candidate.at.node as usize) == Some(&true);
        let graph = self.steps.graph;
        let is_elsewhere = |candidate: &Candidate| {
            component.is_some_and(|own| graph.component_of(candidate.at.node as usize) != own)
        };
        let open = candidates.iter().filter(on_sheet).filter(is_open);
        let best = open.min_by(|a, b| {
            let elsewhere = is_elsewhere(a).cmp(&is_elsewhere(b));
            let away = || a.away_m.total_cmp(&b.away_m);
            elsewhere.then_with(away).then_with(|| a.at.cmp(&b.at))
        });
        best.map(|candidate| candidate.at)
            .ok_or(GroundPathError::NoRoom {
                end,
                at_m,
                radius_m: self.radius_m,
                tolerance_m,
            })
    }

    /// Ground within the tolerance of an end; `None` if all of that is outside of the grid.
    fn candidates(&self, end_m: &Vector3<f64>) -> Option<Vec<Candidate>> {
        let grid = &self.steps.graph.grid;
        let range = |value_m: f64, corner: i32, count: usize| {
            let first = |m: f64| (m / grid.resolution_m).floor() - f64::from(corner);
            let (low, high) = (
                first(value_m - self.tolerance_m),
                first(value_m + self.tolerance_m),
            );
            // False also for what is no number.
            let meets = low < count as f64 && high >= 0.0;
            meets.then(|| low.max(0.0) as usize..=(high as usize).min(count.saturating_sub(1)))
        };
        let columns = range(end_m.x, grid.corner[0], grid.width)?;
        let rows = range(end_m.y, grid.corner[1], grid.height)?;
        let is_ground = self.steps.graph.is_ground();
        let mut found = Vec::new();
        for (y, x) in rows.flat_map(|y| columns.clone().map(move |x| (y, x))) {
            let cell = y * grid.width + x;
            for node in self.steps.graph.of_cell(cell) {
                let Some(at) = Place::new(cell, node) else {
                    continue;
                };
                let away = (self.steps.point_m(at) - end_m).xy();
                let is_own = away.amax() <= 0.5 * grid.resolution_m;
                let away_m = if is_own { 0.0 } else { away.norm() };
                if away_m <= self.tolerance_m && is_ground(self.steps.graph.component_of(node)) {
                    let z_m = self.steps.point_m(at).z;
                    found.push(Candidate { at, z_m, away_m });
                }
            }
        }
        Some(found)
    }
}
