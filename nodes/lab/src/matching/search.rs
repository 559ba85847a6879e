//! Search of poses around a guess.

use super::align::{EMPTY_MAP, begin, end, moved, sample_of};
use super::{Alignment, MultiResolutionList};
use crate::AnyError;
use lattice_core::cloud::Cloud;
use lattice_core::voxels::VoxelStore;
use nalgebra::{Isometry3, Point3, Vector3};
use rayon::prelude::*;

/// Half widths of the searched range around a pose; 0 keeps an axis fixed.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Spread {
    /// Translation along the axes of the map, metres.
    pub translation_m: [f64; 3],
    /// Rotation vector about the axes of the map through the datum of the scan, radians, at most pi. The datum should
    /// be the position of the scanner.
    pub rotation_rad: [f64; 3],
}

/// Limit of searched points of a scan, one per cell; as in the original.
const SEARCHED_POINTS: usize = 2000;
/// Number of poses kept per level and returned.
pub(super) const KEEP: usize = 100;
/// Range of the features, at which a rotation step displaces a point as far as a translation step, metres.
const FEATURE_RANGE_M: f64 = 8.0;
/// Limit of poses of the coarsest grid, at 8 bytes each.
const MAX_POSES: f64 = 5e6;

/// Offset from a central pose: three translations (metres), then a rotation vector (radians).
type Offset = [f64; 6];

/// Best poses of a scan in a range around a guess, best first; at most [`KEEP`].
///
/// The coarsest level tests a grid of poses, one cell size apart and, in rotation, a cell size over the range of the
/// features. The best ones are kept and halved along every searched axis, level by level. Among equally good poses,
/// the first of the grid comes first, for any number of threads.
///
/// # Errors
/// As [`align`](super::align), and for a grid of too many poses.
pub fn search(
    map: &MultiResolutionList,
    cloud: &Cloud,
    map_from_cloud: &Isometry3<f64>,
    spread: &Spread,
) -> Result<Vec<Alignment>, AnyError> {
    let middle = begin(map, cloud, map_from_cloud)?;
    let coarsest = map.levels().last().ok_or(EMPTY_MAP)?;
    let side_m = coarsest.lattice().cell_side_m();
    let grid = Grid::new(spread, side_m, side_m / FEATURE_RANGE_M);
    let mut spreads = spread.translation_m.iter().chain(&spread.rotation_rad);
    if !spreads.all(|half| half.is_finite()) || grid.poses() > MAX_POSES {
        let poses = grid.poses();
        let words = format!("{poses} poses on the coarsest grid, at most {MAX_POSES} are allowed");
        return Err(words.into());
    }
    let pose = |o: &Offset| {
        let [x, y, z, a, b, c] = *o;
        let (shift, turn) = (Vector3::new(x, y, z), Vector3::new(a, b, c));
        moved(&middle, &Point3::origin(), &shift, &turn)
    };
    let mut kept: Vec<(usize, Offset)> = Vec::new();
    let (mut evaluations, mut sampled) = (0, 0);
    let mut spacing = grid.spacing;
    for (number, list) in map.levels().iter().rev().enumerate() {
        let points = sample_of(&cloud.offsets_m, list.lattice(), SEARCHED_POINTS, 0)?;
        let score = |offset: &Offset| list.overlap(&pose(offset), &points);
        let (tried, best) = if number == 0 {
            let all = grid.poses() as usize;
            let at = |place: usize| grid.at(place);
            (all, best_of(all, at, score, KEEP))
        } else {
            spacing = spacing.map(|s| s / 2.0);
            let children: Vec<Offset> = (kept.iter())
                .flat_map(|(_, parent)| divided(parent, &spacing))
                .collect();
            let at = |place: usize| children.get(place).copied().unwrap_or([0.0; 6]);
            let best = best_of(children.len(), at, score, KEEP);
            (children.len(), best)
        };
        evaluations += tried;
        sampled = points.len();
        kept = best;
    }
    let alignment = |(hits, offset): &(usize, Offset)| Alignment {
        map_from_cloud: end(cloud, &pose(offset)),
        hits: *hits,
        points: sampled,
        evaluations,
    };
    Ok(kept.iter().map(alignment).collect())
}

/// Best `keep` of `n` poses, best first; among equals, the first.
fn best_of(
    n: usize,
    at: impl Fn(usize) -> Offset + Sync,
    score: impl Fn(&Offset) -> usize + Sync,
    keep: usize,
) -> Vec<(usize, Offset)> {
    let score = |place: usize| score(&at(place)) as u32;
    let scores: Vec<u32> = (0..n).into_par_iter().map(score).collect();
    let mut places: Vec<u32> = (0..n as u32).collect();
    let lot = |place: &u32| {
        let score = scores.get(*place as usize).copied().unwrap_or(0);
        (std::cmp::Reverse(score), *place)
    };
    if n > keep {
        places.select_nth_unstable_by_key(keep, lot);
        places.truncate(keep);
    }
    places.sort_unstable_by_key(lot);
    let found = |place: u32| (lot(&place).0.0 as usize, at(place as usize));
    places.into_iter().map(found).collect()
}

/// Regular grid of offsets over a range: each is the centre of its part.
struct Grid {
    counts: [f64; 6],
    half: Offset,
    spacing: Offset,
}

impl Grid {
    /// Upper bound of the step size.
    fn new(spread: &Spread, step_m: f64, step_rad: f64) -> Grid {
        let [x, y, z] = spread.translation_m;
        let [a, b, c] = spread.rotation_rad;
        let half = [x, y, z, a, b, c];
        let steps = [step_m, step_m, step_m, step_rad, step_rad, step_rad];
        let count = |(half, step): (f64, f64)| (2.0 * half / step).ceil().max(1.0);
        let counts: [f64; 6] = std::array::from_fn(|i| count((half[i], steps[i])));
        Grid {
            counts,
            half,
            spacing: std::array::from_fn(|i| 2.0 * half[i] / counts[i]),
        }
    }

    fn poses(&self) -> f64 {
        self.counts.iter().product()
    }

    fn at(&self, mut place: usize) -> Offset {
        let mut offset = [0.0; 6];
        for (i, offset) in offset.iter_mut().enumerate() {
            let count = self.counts[i] as usize;
            let along = (place % count) as f64 + 0.5;
            place /= count;
            *offset = along * self.spacing[i] - self.half[i];
        }
        offset
    }
}

/// Centres of the halves of the part of an offset, along every searched axis; `spacing` is that of the halves.
fn divided(parent: &Offset, spacing: &Offset) -> Vec<Offset> {
    let mut children = vec![*parent];
    for (axis, spacing) in spacing.iter().enumerate() {
        if *spacing == 0.0 {
            continue;
        }
        let halves = |child: Offset| {
            [-0.5, 0.5].map(|sign| {
                let mut half = child;
                half[axis] += sign * spacing;
                half
            })
        };
        children = children.into_iter().flat_map(halves).collect();
    }
    children
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_grid_covers_the_spread_and_its_shares_divide_it() {
        let spread = Spread {
            translation_m: [1.0, 0.0, 0.3],
            rotation_rad: [0.0, 0.0, 0.2],
        };
        let grid = Grid::new(&spread, 0.5, 0.15);
        assert_eq!(grid.counts, [4.0, 1.0, 2.0, 1.0, 1.0, 3.0]);
        let all: Vec<Offset> = (0..24).map(|i| grid.at(i)).collect();
        let spacing = grid.spacing.map(|s| s / 2.0);
        let fine = |o: &Offset| divided(o, &spacing);
        let mut finer: Vec<Offset> = all.iter().flat_map(fine).collect();
        assert_eq!(finer.len(), 24 * 8);
        for axis in 0..6 {
            let mut along: Vec<f64> = finer.iter().map(|o| o[axis]).collect();
            along.sort_by(f64::total_cmp);
            along.dedup_by(|a, b| (*a - *b).abs() < 1e-12);
            let (half, count) = (grid.half[axis], along.len() as f64);
            for (i, value) in along.iter().enumerate() {
                let expected = (i as f64 + 0.5) * 2.0 * half / count - half;
                assert!((value - expected).abs() < 1e-12);
            }
        }
        finer.dedup();
        assert_eq!(finer.len(), 24 * 8);
    }

    #[test]
    fn the_best_come_first_and_equal_ones_in_order() {
        let at = |place: usize| [place as f64, 0.0, 0.0, 0.0, 0.0, 0.0];
        let score = |o: &Offset| (o[0] as usize * 7) % 5;
        let best = best_of(20, at, score, 6);
        let scores = best.iter().map(|(hits, o)| (*hits, o[0] as usize));
        let scores: Vec<_> = scores.collect();
        assert_eq!(scores, [(4, 2), (4, 7), (4, 12), (4, 17), (3, 4), (3, 9)]);
        assert_eq!(best_of(0, at, score, 6), []);
    }
}
