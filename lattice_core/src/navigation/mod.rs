//! Occupancy grids for robots on the ground, from the occupied voxels of any lattice.
//!
//! [`Projector`] finds the ground instead of assuming a height for it:
//!
//! 1. **Samples.** A voxel is a sample at the mean of its points, rounded to 1/64 of the cell size. The mean of points on a plane is on the plane, so
//!    heights are finer than the cells. Samples near the centre of a column of the grid are those of the column.
//! 2. **Spans.** The samples of a column in order of height, separated where the robot fits between two of them.
//!    The top of a span is a surface if its samples surround the centre.
//! 3. **Inclination** of a surface along an axis: the median of both sides and of the lesser inclination of the ground
//!    beyond, and no more than the steeper one if the rise is a step that the robot drives over. So a step has none.
//! 4. **Step**: range of the samples about the inclination of the ground beyond. A ramp has none, a curb its height.
//! 5. **Reach.** Standable surfaces of neighbouring columns are linked where a step is low enough, and the robot
//!    reaches all that are linked with the surface below it.
//! 6. **Cells.** Reached is free. Occupied is matter where nothing is reached, if it is tall, steep, or beside a
//!    reached column; and the edge of a drop. Between two seen heights whose mean slope is too steep something is
//!    too steep: a drop-off whose side was never seen. All else is unknown.
//!
//! [`GroundMap`] has the linked surfaces of all floors, and finds paths of a robot on them.
//!
//! Every figure depends on the voxels alone, so a grid after any history of changes is that of the current map.

mod cells;
mod columns;
mod elevation;
mod elevation_limit;
mod flat;
mod grid;
mod grid_limit;
mod ground_map;
mod ground_path_error;
mod ground_search;
mod options;
mod path_ends;
mod path_points;
mod reach;
mod refresh;
mod robot_room;
mod surface_graph;
mod surface_steps;
mod surfaces;
mod terrain;
mod tiles;

use std::sync::Arc;

use nalgebra::Vector3;

use self::columns::Columns;
use self::reach::Reached;
use self::surface_graph::SurfaceGraph;
use self::surfaces::ColumnState;
use self::tiles::{ColumnSet, Tiles};
use crate::lattice::{Lattice, MortonKey};

pub use elevation::{Elevation, Square};
pub use elevation_limit::MAX_ELEVATION_CELLS;
pub use flat::FreeCells;
pub use grid::{Cell, Grid, MAX_GRID_CELLS};
pub use ground_map::{GroundMap, GroundPath, GroundPathOptions};
pub use ground_path_error::{GroundPathError, PathEnd};
pub use options::{GroundOptions, ProjectionError, ProjectionRule, ProjectorOptions};

/// Projection of a map onto the ground, kept up to date with its changes.
///
/// ```
/// use lattice_core::lattice::{Lattice, LatticeKind};
/// use lattice_core::nalgebra::Vector3;
/// use lattice_core::navigation::{Cell, Projector, ProjectorOptions};
/// use lattice_core::cloud::Cloud;
/// use lattice_core::voxels::{VoxelList, VoxelStore};
///
/// // A floor of 6 m by 6 m with a wall across.
/// let side = (0..120).map(|i| 0.05 * f64::from(i) + 0.025);
/// let floor = side.clone().flat_map(|x| side.clone().map(move |y| Vector3::new(x, y, 0.0)));
/// let wall = side.clone().flat_map(|y| side.clone().map(move |z| Vector3::new(3.0, y, z)));
/// let points_m: Vec<_> = floor.chain(wall).collect();
/// let lattice = Lattice::new(LatticeKind::Cubic, 0.001)?;
/// let mut list = VoxelList::new(lattice.clone(), Vector3::zeros(), 1_000_000)?;
/// list.insert(&Cloud::from_points(0, Vector3::zeros(), &points_m));
///
/// let mut projector = Projector::new(&lattice, list.datum_m(), ProjectorOptions::default())?;
/// for (key, voxel) in list.sorted() {
///     projector.set(key, Some(voxel.mean_offset_m().into()));
/// }
/// let grid = projector.grid(Some(Vector3::new(1.0, 1.0, 0.3)), None)?;
/// assert_eq!(grid.at_m(1.0, 3.0), Cell::Free);
/// assert_eq!(grid.at_m(3.0, 3.0), Cell::Occupied);
/// assert_eq!(grid.at_m(5.0, 3.0), Cell::Unknown, "not reached");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct Projector {
    columns: Columns,
    options: ProjectorOptions,
    states: Tiles<ColumnState>,
    /// Columns with changed samples since the last grid.
    changed: ColumnSet,
    /// Surfaces of all floors, linked; `None` if they changed since it was made.
    graph: Option<Arc<SurfaceGraph>>,
    /// Number of times that the samples of a column were gathered, of which the work is a multiple.
    #[cfg(test)]
    gathered: u64,
}

impl Projector {
    /// Creates the projection of an empty map whose keys count from `datum_m` (map frame, metres).
    pub fn new(
        lattice: &Lattice,
        datum_m: Vector3<f64>,
        options: ProjectorOptions,
    ) -> Result<Projector, ProjectionError> {
        options.check(lattice)?;
        Ok(Projector {
            columns: Columns::new(lattice, datum_m, options.resolution_of(lattice)),
            options,
            states: Tiles::default(),
            changed: ColumnSet::default(),
            graph: None,
            #[cfg(test)]
            gathered: 0,
        })
    }

    /// Edge of the cells, metres: exactly a number of single precision, as messages have it.
    pub fn resolution_m(&self) -> f64 {
        self.columns.resolution_m
    }

    /// Sets a voxel by the mean of its points minus its centre (map frame axes, metres), or removes it.
    ///
    /// The mean is zero where a map keeps no points. Voxels beyond 2^30 columns are ignored.
    pub fn set(&mut self, key: MortonKey, mean_offset_m: Option<Vector3<f64>>) {
        if let Some(column) = self.columns.set(key, mean_offset_m) {
            self.changed.insert(column);
        }
    }

    /// Grid of the current map, for a robot at `robot_m` (map frame, metres).
    ///
    /// Without a position the ground is the lowest surface at least half as large as the largest one. `free` is for
    /// [`ProjectionRule::Flat`], which knows no free cell without it.
    pub fn grid(
        &mut self,
        robot_m: Option<Vector3<f64>>,
        free: Option<&FreeCells>,
    ) -> Result<Grid, ProjectionError> {
        let ground = match self.options.rule {
            ProjectionRule::Flat { min_z_m, max_z_m } => {
                return flat::grid(&self.columns, [min_z_m, max_z_m], free);
            }
            ProjectionRule::Ground(ground) => ground,
        };
        let reached = Reached::new(&*self.graph(&ground)?, &ground, robot_m);
        Ok(cells::paint(&self.states, &reached, &ground))
    }

    /// Grid of the current map, and the elevation of a square or of the whole grid.
    ///
    /// Fails with [`ProjectionRule::Flat`], and if the map is too wide for a grid.
    pub fn grid_and_elevation(
        &mut self,
        robot_m: Option<Vector3<f64>>,
        square: Option<Square>,
    ) -> Result<(Grid, Result<Elevation, ProjectionError>), ProjectionError> {
        let ProjectionRule::Ground(ground) = self.options.rule else {
            return Err(ProjectionError::FlatRule);
        };
        let reached = Reached::new(&*self.graph(&ground)?, &ground, robot_m);
        let grid = cells::paint(&self.states, &reached, &ground);
        let elevation = elevation::of(&self.states, &reached, &grid, &ground, square);
        Ok((grid, elevation))
    }

    /// Snapshot of the ground for path searches.
    ///
    /// Fails with [`ProjectionRule::Flat`], and if the map is too wide for a grid.
    pub fn ground_map(&mut self) -> Result<GroundMap, GroundPathError> {
        let ProjectionRule::Ground(ground) = self.options.rule else {
            return Err(GroundPathError::FlatRule);
        };
        Ok(GroundMap::new(self.graph(&ground)?, ground))
    }

    /// Linked surfaces of the current map.
    fn graph(&mut self, ground: &GroundOptions) -> Result<Arc<SurfaceGraph>, ProjectionError> {
        if !self.changed.is_empty() {
            self.graph = None;
            // Before surfaces are found on a map that is too wide for a grid.
            Grid::bounds(self.columns.occupied())?;
            let changed = std::mem::take(&mut self.changed);
            let _gathered = refresh::refresh(&self.columns, &mut self.states, &changed, ground);
            #[cfg(test)]
            {
                self.gathered += _gathered;
            }
        }
        if let Some(graph) = &self.graph {
            return Ok(Arc::clone(graph));
        }
        let graph = SurfaceGraph::new(&self.states, self.resolution_m(), ground)?;
        Ok(Arc::clone(self.graph.insert(Arc::new(graph))))
    }
}

#[cfg(test)]
mod tests;
