//! State machine of the projector, without I/O.

use lattice_core::navigation::{
    Cell, Elevation, FreeCells, Grid, GroundMap, GroundPathError, ProjectionError, ProjectionRule,
    Projector,
};
use lattice_msgs::grid_map_msgs::GridMap;
use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};
use lattice_msgs::map_msgs::OccupancyGridUpdate;
use lattice_msgs::nav_msgs::OccupancyGrid;
use lattice_msgs::std_msgs::Header;
use nalgebra::Vector3;

use super::counts::ProjectorCounts;
use super::messages::{elevation_message, grid_message};
use super::options::MapProjectorOptions;
use super::window::Window;
use super::{changes, messages};
use crate::convert::geometry;
use crate::convert::map::VoxelState;
use crate::hurry::Hurry;
use crate::map_follower::{FollowError, Followed, FollowedMap, MapFollower};

/// Distance that a robot moves before the grid is made anew without a change of the map, metres.
const MOVED_M: f64 = 0.5;

/// Messages of one change of the grid.
#[derive(Clone, Debug, PartialEq)]
pub enum Projected {
    /// A grid of another place or size.
    Grid(OccupancyGrid),
    /// Changed rectangles of the last grid.
    Updates(Vec<OccupancyGridUpdate>),
}

/// Follows a map and keeps its occupancy grid.
pub struct MapProjector {
    options: MapProjectorOptions,
    follower: MapFollower,
    free: MapFollower,
    projector: Option<Projector>,
    /// True if the map has changed since the last grid.
    changed: bool,
    robot_m: Option<Vector3<f64>>,
    grid: Option<Grid>,
    /// True if elevation is made with each grid.
    draws_elevation: bool,
    elevation: Option<Elevation>,
    counts: ProjectorCounts,
    error: Option<ProjectionError>,
    elevation_error: Option<ProjectionError>,
}

impl MapProjector {
    /// Initial state without a map.
    pub fn new(options: MapProjectorOptions) -> Self {
        Self {
            follower: MapFollower::new(options.max_voxels),
            free: MapFollower::new(options.max_voxels),
            projector: None,
            changed: false,
            robot_m: None,
            grid: None,
            draws_elevation: false,
            elevation: None,
            counts: ProjectorCounts::default(),
            error: None,
            elevation_error: None,
            options,
        }
    }

    /// Leaves keyframes out after `hurry`.
    pub fn hurried_by(mut self, hurry: &Hurry) -> Self {
        self.follower = self.follower.hurried_by(hurry);
        self.free = self.free.hurried_by(hurry);
        self
    }

    /// Forgets the map; counters stay.
    pub fn clear(&mut self) {
        let counts = std::mem::take(&mut self.counts);
        *self = Self::new(self.options.clone());
        self.counts = counts;
    }

    /// Changes the options; the next grid is made anew.
    pub fn set_options(&mut self, options: MapProjectorOptions) {
        self.follower.set_max_voxels(options.max_voxels);
        self.free.set_max_voxels(options.max_voxels);
        if self.options.projector != options.projector {
            self.projector = None;
            self.changed = true;
        }
        self.changed |= self.options.elevation_length_m != options.elevation_length_m;
        self.options = options;
    }

    /// Handles a keyframe chunk.
    pub fn on_map(&mut self, message: &LatticeMap) -> Result<Followed, FollowError> {
        let result = self.follower.on_map(message);
        self.after(&result);
        result
    }

    /// Handles an update chunk.
    pub fn on_update(&mut self, message: &LatticeMapUpdate) -> Result<Followed, FollowError> {
        let result = self.follower.on_update(message);
        self.after(&result);
        result
    }

    /// Handles a chunk of free cells.
    pub fn on_free(&mut self, message: &LatticeMap) -> Result<Followed, FollowError> {
        let result = self.free.on_map(message);
        self.count(&result);
        let (touched, replaced) = self.free.take_touched();
        self.changed |= replaced || !touched.is_empty();
        result
    }

    /// Sets the position of the robot in the frame of the map, metres.
    pub fn set_robot(&mut self, robot_m: Vector3<f64>) {
        let moved = |from: Vector3<f64>| (from - robot_m).norm() > MOVED_M;
        if self.robot_m.is_none_or(moved) {
            self.robot_m = Some(robot_m);
            self.changed = true;
        }
    }

    /// Sets whether elevation is made with each grid; the first one comes with the next call of
    /// [`MapProjector::take_change`].
    pub fn draw_elevation(&mut self, draws: bool) {
        let draws = draws && self.options.has_ground();
        self.changed |= draws && !self.draws_elevation;
        self.draws_elevation = draws;
    }

    /// True if a keyframe is to be requested because an incomplete one has timed out. To be called once a second.
    pub fn check_keyframe_timeout(&mut self) -> bool {
        self.follower.check_keyframe_timeout()
    }

    /// Change of the grid since the last call; `None` if there is none, or no map yet.
    pub fn take_change(&mut self) -> Option<Projected> {
        // A map whose first keyframe is incomplete has only a part of its ground.
        if !self.changed || self.follower.sequence().is_none() {
            return None;
        }
        self.changed = false;
        let grid = match self.make() {
            Ok(grid) => grid?,
            Err(error) => {
                self.counts.grids_refused += 1;
                self.error = Some(error);
                return None;
            }
        };
        self.error = None;
        let map = self.follower.map()?;
        let before = self.grid.as_ref();
        let is_same = before.is_some_and(|before| Window::of(before) == Window::of(&grid));
        let change = match before.filter(|_| is_same) {
            Some(before) => {
                let updates = changes::rectangles(before, &grid);
                let updates = updates
                    .iter()
                    .map(|part| messages::update(&grid, part, header_of(map)));
                Projected::Updates(updates.collect())
            }
            None => Projected::Grid(grid_message(&grid, header_of(map))),
        };
        self.grid = Some(grid);
        match &change {
            Projected::Updates(updates) if updates.is_empty() => return None,
            Projected::Updates(updates) => self.counts.updates_out += updates.len() as u64,
            Projected::Grid(_) => self.counts.grids_out += 1,
        }
        Some(change)
    }

    /// Elevation that was made with the last grid, once.
    pub fn take_elevation(&mut self) -> Option<GridMap> {
        let (elevation, map) = (self.elevation.take()?, self.follower.map()?);
        self.counts.elevations_out += 1;
        Some(elevation_message(&elevation, header_of(map)))
    }

    /// True if elevation is not made for want of the robot's position.
    pub fn misses_robot(&self) -> bool {
        self.draws_elevation && self.options.elevation_square(self.robot_m).is_none()
    }

    /// The last grid as a whole, such as for late joiners.
    pub fn whole_grid(&mut self) -> Option<OccupancyGrid> {
        let (grid, map) = (self.grid.as_ref()?, self.follower.map()?);
        self.counts.grids_out += 1;
        Some(grid_message(grid, header_of(map)))
    }

    /// Snapshot of the ground for path searches; `None` before the first keyframe is complete.
    pub fn ground_map(&mut self) -> Option<Result<GroundMap, GroundPathError>> {
        self.follower.sequence()?;
        let projector = projector_of(&mut self.projector, &self.follower, &self.options);
        projector
            .map_err(GroundPathError::from)
            .transpose()
            .map(|projector| projector?.ground_map())
    }

    /// Makes the grid in its window.
    fn make(&mut self) -> Result<Option<Grid>, ProjectionError> {
        let Some(projector) = projector_of(&mut self.projector, &self.follower, &self.options)?
        else {
            return Ok(None);
        };
        let free = self
            .free
            .map()
            .filter(|_| !self.options.has_ground())
            .map(|free| FreeCells {
                lattice: free.lattice.clone(),
                datum_m: free.datum_m,
                keys: free.voxels().keys().copied().collect(),
            });
        let square = self.options.elevation_square(self.robot_m);
        let (grid, elevation) = match square.filter(|_| self.draws_elevation) {
            Some(square) => {
                let (grid, elevation) = projector.grid_and_elevation(self.robot_m, square)?;
                (grid, Some(elevation))
            }
            None => (projector.grid(self.robot_m, free.as_ref())?, None),
        };
        (self.elevation, self.elevation_error) = match elevation.transpose() {
            Ok(elevation) => (elevation, None),
            Err(error) => {
                self.counts.elevations_refused += 1;
                (None, Some(error))
            }
        };
        let known = Window::of(&grid);
        let room = (self.options.room_m / grid.resolution_m).ceil() as u32;
        let before = self.grid.as_ref();
        let before = before.filter(|before| before.resolution_m == grid.resolution_m);
        match before
            .map(Window::of)
            .filter(|window| window.contains(&known))
        {
            Some(window) => grid.within(window.corner, window.width, window.height),
            None => {
                let wide = known.with_room(room);
                let wide = grid.within(wide.corner, wide.width, wide.height);
                // Without room where the grid would be too large with it.
                wide.or(Ok(grid))
            }
        }
        .map(Some)
    }

    /// The rule of the projection.
    pub fn rule(&self) -> ProjectionRule {
        self.options.projector.rule
    }

    /// Counters of messages and grids.
    pub fn counts(&self) -> &ProjectorCounts {
        &self.counts
    }

    /// Error of the last grid, or of its elevation, if it was not made.
    pub fn error(&self) -> Option<&ProjectionError> {
        self.error.as_ref().or(self.elevation_error.as_ref())
    }

    /// Number of voxels of the followed map; 0 before its first keyframe.
    pub fn voxels(&self) -> usize {
        self.follower.map().map_or(0, |map| map.voxels().len())
    }

    /// Number of detected differences from the mapper's map.
    pub fn map_differences(&self) -> u64 {
        self.follower.differences()
    }

    /// Frame of the map; `None` before its first keyframe.
    pub fn map_frame(&self) -> Option<&str> {
        self.follower.map().map(|map| map.frame_id.as_str())
    }

    /// Free, occupied and unknown cells of the last grid.
    pub fn cells(&self) -> [usize; 3] {
        let count = |state| self.grid.as_ref().map_or(0, |grid| grid.count(state));
        [Cell::Free, Cell::Occupied, Cell::Unknown].map(count)
    }

    fn count(&mut self, result: &Result<Followed, FollowError>) {
        self.counts.messages_in += 1;
        match result {
            Err(_) => self.counts.messages_refused += 1,
            Ok(Followed::NeedKeyframe) => self.counts.gaps += 1,
            Ok(_) => {}
        }
    }

    fn after(&mut self, result: &Result<Followed, FollowError>) {
        self.count(result);
        let (touched, replaced) = self.follower.take_touched();
        if replaced {
            self.projector = None;
            self.grid = None;
        }
        self.changed |= replaced || !touched.is_empty();
        if let (Some(projector), Some(map)) = (&mut self.projector, self.follower.map()) {
            for key in touched {
                let state = map.voxels().get(&key);
                projector.set(key, state.map(|state| offset_m(map, state)));
            }
        }
    }
}

/// Projector of a followed map, made with all of its voxels if there is none; `None` without a map.
fn projector_of<'a>(
    projector: &'a mut Option<Projector>,
    follower: &MapFollower,
    options: &MapProjectorOptions,
) -> Result<Option<&'a mut Projector>, ProjectionError> {
    let Some(map) = follower.map() else {
        return Ok(None);
    };
    Ok(Some(match projector {
        Some(projector) => projector,
        none => {
            let mut projector = Projector::new(&map.lattice, map.datum_m, options.projector)?;
            for (key, state) in map.voxels() {
                projector.set(*key, Some(offset_m(map, state)));
            }
            none.insert(projector)
        }
    }))
}

/// Mean of a voxel's points minus the centre of its cell, metres.
fn offset_m(map: &FollowedMap, state: &VoxelState) -> Vector3<f64> {
    Vector3::from(state.mean_offset.map(f64::from)) * map.offset_unit_m
}

fn header_of(map: &FollowedMap) -> Header {
    geometry::header(&map.frame_id, map.stamp_ns)
}
