//! Paths of long straight segments.

use nalgebra::Vector3;

use super::path::{Path, PathOptions};
use super::path_error::PathError;
use super::{Query, QueryError, Segment};
use crate::voxels::VoxelStore;

/// Limits of the first stride, cells: with 1 a point needs millions of cells in the open, and above 8 the blocks that a
/// step may pass through are too many to be worth it.
const STRIDES: std::ops::RangeInclusive<f64> = 2.0..=8.0;

impl<S: VoxelStore> Query<'_, S> {
    /// Finds a path of long free segments for a ball in a fraction of the time of [`Query::shortest_path`].
    ///
    /// Steps of up to two radii (or four cells) in many directions are searched first, then steps of half the length, down to those
    /// of `shortest_path`, until a path is found. Each place and each step is tested against all cells. The path is
    /// shortened: `keys` are the cells of its corners. Long steps may miss a gap that is hardly wider than the ball,
    /// and find a longer way. `options.steps` are those of single cells.
    pub fn straight_path(
        &self,
        start_m: &Vector3<f64>,
        goal_m: &Vector3<f64>,
        options: &PathOptions,
    ) -> Result<Path, PathError> {
        self.straight_path_while(start_m, goal_m, options, || true)
    }

    /// As [`Query::straight_path`], but stops as at the cell limit when `go_on` returns false, which is called before
    /// each expansion.
    pub fn straight_path_while(
        &self,
        start_m: &Vector3<f64>,
        goal_m: &Vector3<f64>,
        options: &PathOptions,
        mut go_on: impl FnMut() -> bool,
    ) -> Result<Path, PathError> {
        let [start, goal] = self.ends(start_m, goal_m, options)?;
        let strides = options.radius_m / self.store.lattice().cell_side_m();
        let mut stride = 1 << strides.clamp(*STRIDES.start(), *STRIDES.end()).log2() as i32;
        let mut expanded = 0;
        loop {
            let left = PathOptions {
                max_expanded: options.max_expanded.saturating_sub(expanded),
                ..*options
            };
            match self.search(start, goal, &left, stride, &mut go_on) {
                Ok((cells, more)) => {
                    let path = self.path_along(&cells, expanded + more);
                    return Ok(self.shortened(path, options.radius_m)?);
                }
                Err(PathError::NoPath { expanded: more }) if stride > 1 => expanded += more,
                Err(PathError::NoPath { expanded: more }) => {
                    let expanded = expanded + more;
                    return Err(PathError::NoPath { expanded });
                }
                Err(PathError::Limit { expanded: more }) => {
                    let expanded = expanded + more;
                    return Err(PathError::Limit { expanded });
                }
                Err(error) => return Err(error),
            }
            stride /= 2;
        }
    }

    fn shortened(&self, path: Path, radius_m: f64) -> Result<Path, QueryError> {
        let centers_m = self.shorten(&path.centers_m, radius_m)?;
        let steps = centers_m.iter().zip(centers_m.iter().skip(1));
        Ok(Path {
            keys: centers_m
                .iter()
                .filter_map(|center_m| self.store.key_of(center_m))
                .collect(),
            length_m: steps.map(|(a, b)| (b - a).norm()).sum(),
            centers_m,
            expanded: path.expanded,
        })
    }

    /// Shortens a path by straight segments that keep a ball clear of occupied cells; the ends stay.
    ///
    /// Only occupied cells are tested. Each point is connected to the last visible one of its run, so that there are
    /// as many visibility tests as points.
    pub fn shorten(
        &self,
        path_m: &[Vector3<f64>],
        radius_m: f64,
    ) -> Result<Vec<Vector3<f64>>, QueryError> {
        let Some((&first, rest)) = path_m.split_first() else {
            return Err(QueryError::EmptyPath);
        };
        let mut short = vec![first];
        let mut from_m = first;
        let mut seen = first;
        for &to_m in rest {
            if !self.is_free(&Segment { from_m, to_m }, radius_m)? && seen != from_m {
                short.push(seen);
                from_m = seen;
            }
            seen = to_m;
        }
        if seen != first || short.len() > 1 {
            short.push(seen);
        }
        Ok(short)
    }
}
