//! Cells at which a ball fits, and steps on which it fits all the way.

use rustc_hash::FxHashMap;

use super::Segment;
use super::clearance::cell_distance_m;
use super::limits::MAX_ROBOT_CELLS;
use super::path_error::PathError;
use super::shells::{add, steps_within};
use super::stencil::{Around, Stencil};
use super::step_length::StepLength;
use crate::lattice::{Lattice, LatticeIndex};
use crate::voxels::VoxelStore;

/// Sets of the cells that block a ball on a lattice or on every n-th point of it along each basis vector.
pub(super) struct Corridor {
    /// Distance of the places of the ball along the basis vectors, cells.
    pub(super) stride: i32,
    /// Index difference, in strides, and length of each step, metres.
    pub(super) steps: Vec<(LatticeIndex, f64)>,
    /// Cells that touch the ball at the centre of cell 0.
    pub(super) ball: Stencil,
    /// Cells that touch the ball on each step from cell 0.
    pub(super) ways: Vec<Stencil>,
    /// Cells of the ball and of all steps.
    pub(super) all: Stencil,
}

impl Corridor {
    pub(super) fn new(
        lattice: &Lattice,
        radius_m: f64,
        steps: &[LatticeIndex],
        stride: i32,
    ) -> Result<Corridor, PathError> {
        let covering_m = lattice.covering_radius_m();
        // Cells are within a covering radius of the ball; see below for the slack.
        let reach_m = radius_m + 1.001 * covering_m;
        check_size(lattice, radius_m, reach_m)?;
        // Contact blocks; the slack makes that independent of rounding.
        let blocked_m = radius_m + 1e-9 * covering_m;
        let length_m = |step: &LatticeIndex| f64::from(stride) * lattice.center(*step).norm();
        let longest_m = steps.iter().map(length_m).fold(0.0, f64::max);
        let near = steps_within(lattice, reach_m + longest_m);
        let touching = |to: LatticeIndex| -> Vec<LatticeIndex> {
            let (from_m, to_m) = (lattice.center([0; 3]), lattice.center(to));
            let line = Segment { from_m, to_m };
            let touches = |w: &LatticeIndex| {
                let center_m = lattice.center(*w);
                // Most cells are told by the radii between which their surface lies.
                let beyond_m = line.distance_m(&center_m) - radius_m;
                beyond_m < 0.999 * lattice.packing_radius_m()
                    || beyond_m < 1.001 * covering_m
                        && cell_distance_m(&line, lattice.cell(), &center_m) <= blocked_m
            };
            near.iter().map(|step| step.by).filter(touches).collect()
        };
        let ball = touching([0; 3]);
        // One direction decides for both, so that paths are reversible.
        let mut forward = FxHashMap::default();
        let mut way = |&step: &LatticeIndex| -> Vec<LatticeIndex> {
            let to = step.map(|w| stride * w);
            let back = to.map(|w| -w);
            let cells = forward
                .entry(to.max(back))
                .or_insert_with(|| touching(to.max(back)));
            let by = if to > back { [0; 3] } else { to };
            cells.iter().map(|w| add(*w, by)).collect()
        };
        let ways: Vec<_> = steps.iter().map(&mut way).collect();
        Ok(Corridor {
            all: Stencil::new(ways.iter().chain([&ball]).flatten().copied()),
            ball: Stencil::new(ball),
            ways: ways.into_iter().map(Stencil::new).collect(),
            steps: steps.iter().map(|step| (*step, length_m(step))).collect(),
            stride,
        })
    }

    /// Steps to touching places, and each two of them one after the other where that is another direction: 50 to 98
    /// steps, 3.6 to 3.8 times as many.
    pub(super) fn long_steps(lattice: &Lattice) -> Vec<LatticeIndex> {
        let near = lattice.touching_neighbors();
        let mut steps = near.to_vec();
        for (&a, &b) in near.iter().flat_map(|a| near.iter().map(move |b| (a, b))) {
            let to = add(a, b);
            let primitive = to.iter().any(|w| w % 2 != 0);
            if primitive && !steps.contains(&to) {
                steps.push(to);
            }
        }
        steps
    }

    /// Lower bound on the length of walks: the norm of the steps, or where these have most directions, the distance.
    pub(super) fn bound(&self, lattice: &Lattice) -> StepLength {
        if self.stride > 1 {
            return StepLength::straight(lattice);
        }
        StepLength::new(lattice, self.steps.iter().map(|step| step.0))
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

    /// Occupied cells about the places of a block.
    pub(super) fn around(&self, store: &impl VoxelStore, first: LatticeIndex) -> Around {
        let [low, mut high] = self.all.blocks();
        if self.stride > 1 {
            // The first place may be any cell of its block.
            high = high.map(|i| i + (7 * self.stride + 7) / 8);
        }
        Around::new(first, [low, high], |block| store.block_mask(block))
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
