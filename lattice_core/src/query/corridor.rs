//! Stencils of the cells that block a ball at the centre of a cell and on a step to the next.

use rustc_hash::FxHashSet;

use super::Segment;
use super::clearance::cell_distance_m;
use super::limits::MAX_ROBOT_CELLS;
use super::path_error::PathError;
use super::shells::{add, steps_within};
use crate::lattice::{Lattice, LatticeIndex, MortonKey};
use crate::voxels::VoxelStore;

pub(super) struct Corridor {
    /// Cells that touch the ball at the centre of cell 0, nearest first.
    at: Vec<LatticeIndex>,
    /// Index difference and length of each step.
    pub(super) steps: Vec<(LatticeIndex, f64)>,
    /// For each step, cells that touch the ball between its ends only.
    between: Vec<Vec<LatticeIndex>>,
}

impl Corridor {
    pub(super) fn new(
        lattice: &Lattice,
        radius_m: f64,
        steps: &[LatticeIndex],
    ) -> Result<Corridor, PathError> {
        let covering_m = lattice.covering_radius_m();
        // Cells are within a covering radius of the ball; see below for the slack.
        let reach_m = radius_m + 1.001 * covering_m;
        check_size(lattice, radius_m, reach_m)?;
        // Contact blocks; the slack makes that independent of rounding.
        let blocked_m = radius_m + 1e-9 * covering_m;
        let touching = |line: &Segment, reach_m: f64| -> Vec<LatticeIndex> {
            let near = steps_within(lattice, reach_m)
                .into_iter()
                .map(|step| step.by);
            let distance_m = |w| cell_distance_m(line, lattice.cell(), &lattice.center(w));
            near.filter(|&w| distance_m(w) <= blocked_m).collect()
        };
        let zero = lattice.center([0; 3]);
        let way = |to: LatticeIndex| Segment {
            from_m: zero,
            to_m: lattice.center(to),
        };
        let at = touching(&way([0; 3]), reach_m);
        let ball: FxHashSet<LatticeIndex> = at.iter().copied().collect();
        let between = |&to: &LatticeIndex| -> Vec<LatticeIndex> {
            let back = to.map(|w| -w);
            // One direction decides for both, so that paths are reversible.
            let forward = if to > back { to } else { back };
            let line = way(forward);
            let cells = touching(&line, reach_m + line.to_m.norm());
            let behind = forward.map(|w| -w);
            let new = |w: &LatticeIndex| !ball.contains(w) && !ball.contains(&add(*w, behind));
            let shift = if to == forward { [0; 3] } else { to };
            let cells = cells.into_iter().filter(new);
            cells.map(|w| add(w, shift)).collect()
        };
        Ok(Corridor {
            at,
            between: steps.iter().map(between).collect(),
            steps: steps
                .iter()
                .map(|&to| (to, lattice.center(to).norm()))
                .collect(),
        })
    }

    /// Cells with centres within a distance of that of cell 0, nearest first.
    pub(super) fn ball_cells(
        lattice: &Lattice,
        radius_m: f64,
    ) -> Result<Vec<LatticeIndex>, PathError> {
        check_size(lattice, radius_m, radius_m)?;
        let steps = steps_within(lattice, radius_m);
        Ok(steps.into_iter().map(|step| step.by).collect())
    }

    /// Tests whether the ball fits at the centre of a cell.
    pub(super) fn is_clear(&self, store: &impl VoxelStore, w: LatticeIndex) -> bool {
        none_occupied(store, w, &self.at)
    }

    /// Tests whether the ball, which fits at both ends, fits between them.
    pub(super) fn is_way_clear(
        &self,
        store: &impl VoxelStore,
        w: LatticeIndex,
        step: usize,
    ) -> bool {
        let between = self.between.get(step);
        between.is_some_and(|between| none_occupied(store, w, between))
    }
}

fn check_size(lattice: &Lattice, radius_m: f64, reach_m: f64) -> Result<(), PathError> {
    let volume = 4.0 / 3.0 * std::f64::consts::PI * reach_m.powi(3);
    let cells = volume / lattice.cell_volume_m3();
    if cells.is_nan() || cells > MAX_ROBOT_CELLS as f64 {
        return Err(PathError::Radius { radius_m, cells });
    }
    Ok(())
}

fn none_occupied(store: &impl VoxelStore, w: LatticeIndex, around: &[LatticeIndex]) -> bool {
    let occupied =
        |by: &LatticeIndex| MortonKey::pack(add(w, *by)).is_some_and(|k| store.contains(k));
    !around.iter().any(occupied)
}
