//! Shortest paths of a ball through free cells: A* (Hart, Nilsson & Raphael 1968).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use nalgebra::Vector3;
use rustc_hash::FxHashMap;
use thiserror::Error;

use super::corridor::{Corridor, MAX_ROBOT_CELLS};
use super::error::check_point;
use super::shells::add;
use super::{Query, QueryError, Segment};
use crate::lattice::MortonKey;
use crate::voxels::VoxelStore;

/// Cells that a step may lead to.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Steps {
    /// Cells that share a face.
    #[default]
    Face,
    /// Cells that share a face, an edge or a vertex.
    Touching,
}

/// A box along the axes of the map frame, metres.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Bounds {
    /// Lowest corner.
    pub min_m: Vector3<f64>,
    /// Highest corner.
    pub max_m: Vector3<f64>,
}

impl Bounds {
    /// True for points in the box or on its surface.
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

/// Options of a search for a path.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PathOptions {
    /// Radius of the ball that moves, metres.
    pub radius_m: f64,
    /// Steps that it can take.
    pub steps: Steps,
    /// Box that holds the centres of its cells, map frame; `None` for everywhere.
    pub bounds: Option<Bounds>,
    /// The search gives up after this many cells.
    pub max_expanded: usize,
}

/// A path from cell to cell.
#[derive(Clone, PartialEq, Debug)]
pub struct Path {
    /// The cells, from that of the start to that of the goal.
    pub keys: Vec<MortonKey>,
    /// Their centres, map frame, metres.
    pub centers_m: Vec<Vector3<f64>>,
    /// Length from the first centre to the last, metres.
    pub length_m: f64,
    /// Cells that the search looked around from.
    pub expanded: usize,
}

/// Failure of a search for a path.
#[derive(Clone, PartialEq, Debug, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum PathError {
    /// The question makes no sense.
    #[error(transparent)]
    Query(#[from] QueryError),
    /// The ball is too large for the cells.
    #[error(
        "radius {radius_m} m covers some {cells:.0} cells, at most {MAX_ROBOT_CELLS}: use larger cells"
    )]
    Radius { radius_m: f64, cells: f64 },
    /// The start or goal is out of the bounds or of the range of keys.
    #[error("the cell of {end} {point_m:?} m is out of bounds")]
    OutOfBounds {
        end: &'static str,
        point_m: [f64; 3],
    },
    /// The ball does not fit at the start or goal.
    #[error("the cell of {end} {point_m:?} m is not passable with radius {radius_m} m")]
    Blocked {
        end: &'static str,
        point_m: [f64; 3],
        radius_m: f64,
    },
    /// Every cell that can be reached was looked at.
    #[error("no path: the goal is not among the {expanded} cells that can be reached")]
    NoPath { expanded: usize },
    /// The search gave up.
    #[error("no path found among {expanded} cells: allow more, or set tighter bounds")]
    Limit { expanded: usize },
}

impl<S: VoxelStore> Query<'_, S> {
    /// The shortest path along centres of cells on which a ball touches no occupied cell, neither at
    /// the centres nor between them.
    ///
    /// `start_m` and `goal_m` (map frame) stand for the cells that hold them. Paths of equal length
    /// are chosen between by key, so that the same map gives the same path.
    pub fn shortest_path(
        &self,
        start_m: &Vector3<f64>,
        goal_m: &Vector3<f64>,
        options: &PathOptions,
    ) -> Result<Path, PathError> {
        self.shortest_path_while(start_m, goal_m, options, || true)
    }

    /// As [`Query::shortest_path`]; gives up as at the limit of cells once `go_on` says no, which is
    /// asked before each cell that is looked around from.
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
        // Shortest in total first, then nearest to the goal, then lowest key, and with it the length
        // on the way there; the bits of a distance order as it does.
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

    /// Centre (map frame) of the cell in whose middle a ball fits and that is nearest to that of the
    /// point, at most `within_m` from it; `None` if there is none.
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

    /// Takes corners out of a path where a straight line keeps a ball clear of occupied cells;
    /// the ends stay, and the path gets no longer. Only occupied cells count, no other rule.
    ///
    /// Goes on from each point to the last one of the run that it sees, so that it takes as many
    /// lines of sight as there are points.
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
    /// The ball fits, but no way there is known.
    Open,
    Reached(Reached),
}

#[derive(Clone, Copy)]
struct Reached {
    from: MortonKey,
    length_m: f64,
}
