//! Coarse search: fewest occupied voxels on lattices of decreasing cell size.

use nalgebra::{Isometry3, SVector};
use rustc_hash::FxHashSet;

use super::{MountCorrection, MountSamples};
use crate::lattice::{Lattice, LatticeKind};

/// Range of the search about each axis, radians.
pub(super) const RANGE_RAD: f64 = 15.0 * std::f64::consts::PI / 180.0;
/// Range of the search along each axis, metres.
pub(super) const RANGE_M: f64 = 1.0;

/// Cell sizes, metres.
const CELLS_M: [f64; 4] = [2.0, 1.0, 0.5, 0.25];
/// Rotation per metre of cell size: a cell at 10 m.
const RAD_PER_M: f64 = 0.1;
/// Passes over the six numbers at one step size.
const MAX_PASSES: usize = 5;
/// Step sizes at one cell size, each half of the one before.
const HALVINGS: usize = 3;
/// Smallest decrease of the number of voxels that is followed.
const LEAST_GAIN: f64 = 5e-4;
/// Most points of the search.
const MAX_POINTS: usize = 40_000;

/// Number of occupied voxels of the samples with a correction.
pub(super) fn occupied(samples: &MountSamples, at: &MountCorrection, cell_m: f64) -> usize {
    let Ok(lattice) = Lattice::new(LatticeKind::Fcc, cell_m.powi(3)) else {
        return 0;
    };
    let fix = at.base_from_stated();
    let poses: Vec<Isometry3<f64>> = samples
        .poses
        .iter()
        .map(|pose| at.map_from_base(pose) * fix)
        .collect();
    let points = samples.points.iter();
    let cells: FxHashSet<_> = points
        .filter_map(|(pose, point)| {
            let pose = poses.get(*pose as usize)?;
            lattice.quantize(&pose.transform_point(&(*point).into()).coords)
        })
        .collect();
    cells.len()
}

/// The correction with the fewest occupied voxels, found number by number.
pub(super) fn search(samples: &MountSamples, stated: &MountCorrection) -> MountCorrection {
    let stride = samples.points.len().div_ceil(MAX_POINTS).max(1);
    let samples = &MountSamples {
        points: samples.points.iter().step_by(stride).copied().collect(),
        ..samples.clone()
    };
    let mut best = stated.vector();
    for cell_m in CELLS_M {
        let count = |at: &SVector<f64, 7>| occupied(samples, &stated.of(at), cell_m) as f64;
        let mut least = count(&best);
        let mut scale = 1.0;
        for _ in 0..HALVINGS {
            for _ in 0..MAX_PASSES {
                let mut has_moved = false;
                // Rotations first: they move more points.
                for number in [2, 1, 0, 3, 4, 5] {
                    let (step, range) = match number {
                        0..3 => (scale * RAD_PER_M * cell_m, RANGE_RAD),
                        _ => (scale * 0.5 * cell_m, RANGE_M),
                    };
                    for sign in [-1.0, 1.0] {
                        let mut tried = best;
                        tried[number] += sign * step;
                        if tried[number].abs() > range {
                            continue;
                        }
                        let voxels = count(&tried);
                        if voxels < least * (1.0 - LEAST_GAIN) {
                            (best, least, has_moved) = (tried, voxels, true);
                            break;
                        }
                    }
                }
                if !has_moved {
                    break;
                }
            }
            scale *= 0.5;
        }
    }
    stated.of(&best)
}
