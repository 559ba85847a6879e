//! Shortest paths of a ball through free cells: A* (Hart, Nilsson & Raphael 1968).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use nalgebra::Vector3;
use rustc_hash::FxHashMap;

use super::corridor::Corridor;
use super::error::check_point;
pub use super::path_error::PathError;
use super::shells::add;
use super::{Query, QueryError, Segment};
use crate::lattice::MortonKey;
use crate::voxels::VoxelStore;

/// Neighbours that a step may reach.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Steps {
    /// Neighbours that share a face.
    #[default]
    Face,
    /// Neighbours that share a face, an edge or a vertex.
    Touching,
}

/// Axis-aligned box in the map frame, metres.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Bounds {
    /// Lowest corner.
    pub min_m: Vector3<f64>,
    /// Highest corner.
    pub max_m: Vector3<f64>,
}

impl Bounds {
    /// Tests whether a point is inside the box or on its surface.
    pub fn contains(&self, point_m: &Vector3<f64>) -> bool {
        (0..3).all(|i| (self.min_m[i]..=self.max_m[i]).contains(&point_m[i]))
    }

    fn check(&self) -> Result<(), QueryError> {
        check_point(&self.min_m)?;
        check_point(&self.max_m)?;
        let extents = self.max_m - self.min_m;
        if extents.iter().all(|x| *x >= 0.0) {
            Ok(())
        } else {
            Err(QueryError::Box(extents.into()))
        }
    }

    fn moved(&self, by_m: &Vector3<f64>) -> Bounds {
        Bounds {
            min_m: self.min_m + by_m,
            max_m: self.max_m + by_m,
        }
    }
}

/// Options of a path search.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PathOptions {
    /// Radius of the moving ball, metres.
    pub radius_m: f64,
    /// Allowed steps.
    pub steps: Steps,
    /// Box that contains the centres of the path's cells, map frame; `None` for no limit.
    pub bounds: Option<Bounds>,
    /// Maximum number of expanded cells.
    pub max_expanded: usize,
}

/// Path of cells.
#[derive(Clone, PartialEq, Debug)]
pub struct Path {
    /// Cells from the start to the goal.
    pub keys: Vec<MortonKey>,
    /// Centres of the cells, map frame, metres.
    pub centers_m: Vec<Vector3<f64>>,
    /// Length from the first centre to the last, metres.
    pub length_m: f64,
    /// Number of expanded cells.
    pub expanded: usize,
}

impl<S: VoxelStore> Query<'_, S> {
    /// Finds the shortest path along cell centres on which a ball touches no occupied cell, neither at the centres
    /// nor between them.
    ///
    /// `start_m` and `goal_m` (map frame) select the cells that contain them. Of equally long paths the one with the
    /// lowest keys is returned, so that the result is deterministic.
    pub fn shortest_path(
        &self,
        start_m: &Vector3<f64>,
        goal_m: &Vector3<f64>,
        options: &PathOptions,
    ) -> Result<Path, PathError> {
        self.shortest_path_while(start_m, goal_m, options, || true)
    }

    /// As [`Query::shortest_path`], but stops as at the cell limit when `go_on` returns false, which is called before
    /// each expansion.
    pub fn shortest_path_while(
        &self,
        start_m: &Vector3<f64>,
        goal_m: &Vector3<f64>,
        options: &PathOptions,
        mut go_on: impl FnMut() -> bool,
    ) -> Result<Path, PathError> {
        super::error::check_distance(options.radius_m)?;
        if let Some(bounds) = &options.bounds {
            bounds.check()?;
        }
        let lattice = self.store.lattice();
        let steps = match options.steps {
            Steps::Face => lattice.face_neighbors(),
            Steps::Touching => lattice.touching_neighbors(),
        };
        let corridor = Corridor::new(lattice, options.radius_m, steps)?;
        let bounds = options.bounds.map(|b| b.moved(&-self.store.datum_m()));
        let inside =
            |key: MortonKey| bounds.is_none_or(|b| b.contains(&lattice.center(key.unpack())));
        let is_open = |key: MortonKey| corridor.is_clear(self.store, key.unpack());
        let end_cell = |end: &'static str, point: &Vector3<f64>| {
            let _ = self.local(point)?;
            let point_m = (*point).into();
            let key = self.store.key_of(point).filter(|&key| inside(key));
            let key = key.ok_or(PathError::OutOfBounds { end, point_m })?;
            let radius_m = options.radius_m;
            let blocked = PathError::Blocked {
                end,
                point_m,
                radius_m,
            };
            if is_open(key) { Ok(key) } else { Err(blocked) }
        };
        let start = end_cell("start", start_m)?;
        let goal = end_cell("goal", goal_m)?;

        let goal_center_m = lattice.center(goal.unpack());
        let to_goal_m = |key: MortonKey| (lattice.center(key.unpack()) - goal_center_m).norm();
        let mut cells = FxHashMap::default();
        // Sorted by total length, then distance to the goal, then key, with the length so far; the bits of a distance
        // sort as the distance does.
        let mut waiting = BinaryHeap::new();
        let entry = |key: MortonKey, length_m: f64| {
            let to_goal_m = to_goal_m(key);
            let total_m = length_m + to_goal_m;
            Reverse((
                total_m.to_bits(),
                to_goal_m.to_bits(),
                key,
                length_m.to_bits(),
            ))
        };
        cells.insert(goal, Cell::Open);
        let reached = Reached {
            from: start,
            length_m: 0.0,
        };
        cells.insert(start, Cell::Reached(reached));
        waiting.push(entry(start, 0.0));
        let mut expanded = 0;
        while let Some(Reverse((_, _, at, length_bits))) = waiting.pop() {
            let Some(Cell::Reached(reached)) = cells.get(&at).copied() else {
                continue;
            };
            if f64::from_bits(length_bits) > reached.length_m {
                continue;
            }
            if at == goal {
                return Ok(self.path_to(goal, reached.length_m, &cells, expanded));
            }
            if expanded == options.max_expanded || !go_on() {
                return Err(PathError::Limit { expanded });
            }
            expanded += 1;
            let w = at.unpack();
            for (i, &(by, step_m)) in corridor.steps.iter().enumerate() {
                let Some(key) = MortonKey::pack(add(w, by)).filter(|&key| inside(key)) else {
                    continue;
                };
                let cell = cells.entry(key).or_insert_with(|| {
                    if is_open(key) {
                        Cell::Open
                    } else {
                        Cell::Closed
                    }
                });
                let length_m = reached.length_m + step_m;
                let better = match cell {
                    Cell::Closed => false,
                    Cell::Open => true,
                    Cell::Reached(known) => length_m < known.length_m,
                };
                if better && corridor.is_way_clear(self.store, w, i) {
                    *cell = Cell::Reached(Reached { from: at, length_m });
                    waiting.push(entry(key, length_m));
                }
            }
        }
        Err(PathError::NoPath { expanded })
    }

    /// Finds the centre (map frame) nearest to a point, at most `within_m` away, at which a ball fits; `None` if
    /// there is none.
    pub fn nearest_passable(
        &self,
        point_m: &Vector3<f64>,
        radius_m: f64,
        within_m: f64,
    ) -> Result<Option<Vector3<f64>>, PathError> {
        super::error::check_distance(radius_m)?;
        super::error::check_distance(within_m)?;
        let _ = self.local(point_m)?;
        let lattice = self.store.lattice();
        let corridor = Corridor::new(lattice, radius_m, &[])?;
        let around = Corridor::ball_cells(lattice, within_m)?;
        let Some(key) = self.store.key_of(point_m) else {
            return Ok(None);
        };
        let cells = around.iter().map(|&by| add(key.unpack(), by));
        let open = cells.filter(|&w| corridor.is_clear(self.store, w));
        let mut keys = open.filter_map(MortonKey::pack);
        Ok(keys.next().map(|key| self.store.center_m(key)))
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

    fn path_to(
        &self,
        goal: MortonKey,
        length_m: f64,
        cells: &FxHashMap<MortonKey, Cell>,
        expanded: usize,
    ) -> Path {
        let before = |key: &MortonKey| match cells.get(key) {
            Some(Cell::Reached(reached)) if reached.from != *key => Some(reached.from),
            _ => None,
        };
        let mut keys: Vec<MortonKey> = std::iter::successors(Some(goal), before).collect();
        keys.reverse();
        Path {
            centers_m: keys.iter().map(|&key| self.store.center_m(key)).collect(),
            keys,
            length_m,
            expanded,
        }
    }
}

#[derive(Clone, Copy)]
enum Cell {
    /// The ball does not fit.
    Closed,
    /// The ball fits, but no path to the cell is known.
    Open,
    Reached(Reached),
}

#[derive(Clone, Copy)]
struct Reached {
    from: MortonKey,
    length_m: f64,
}
