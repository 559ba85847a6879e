//! Path planning: a thread searches in a copy of the cells made by the compute thread.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use lattice_core::query::{Path, PathError, PathOptions, Query, Steps};
use lattice_core::voxels::{OccupancyList, VoxelStore};
use lattice_msgs::geometry_msgs::Point;
use lattice_msgs::lattice::{PlanPathRequest, PlanPathResponse};
use lattice_runtime::{Reply, lock};
use nalgebra::Vector3;

use super::operations::vector;
use super::state::LatticeMapper;

/// Limits of a search: expanded cells, some three seconds of them, and time.
const MAX_EXPANDED: usize = 2_000_000;
const PATIENCE: Duration = Duration::from_secs(3);
/// Limit of cells within the ball of a request, and within the tolerance of an end.
const MAX_BALL_CELLS: f64 = 8192.0;

/// Path planner, one search at a time.
#[derive(Default)]
pub(super) struct Planner {
    busy: AtomicBool,
    copy: Mutex<Option<Copied>>,
}

struct Copied {
    /// Epoch and update sequence.
    state: (u64, u64),
    cells: Arc<OccupancyList>,
}

impl Planner {
    /// Reserves the planner; false while another search runs. A reserved planner must begin or be freed.
    pub(super) fn take(&self) -> bool {
        !self.busy.swap(true, Ordering::AcqRel)
    }

    /// Releases the planner.
    pub(super) fn free(&self) {
        self.busy.store(false, Ordering::Release);
    }

    /// Searches on a thread; the search ends with the service, which owns the planner.
    pub(super) fn begin(
        self: Arc<Self>,
        machine: &LatticeMapper,
        request: PlanPathRequest,
        reply: Reply<PlanPathResponse>,
    ) {
        let (cells, late, planner) = (self.cells(machine), reply.clone(), Arc::clone(&self));
        let search = move || {
            let begun = Instant::now();
            let go_on = || begun.elapsed() < PATIENCE && Arc::strong_count(&planner) > 1;
            let answer = plan(&*cells, &request, go_on);
            planner.free();
            reply.send(answer);
        };
        let thread = thread::Builder::new().name("plan path".to_owned());
        if let Err(error) = thread.spawn(search) {
            self.free();
            late.send(failed(error));
        }
    }

    /// Copy of the cells, made at most once per map update.
    fn cells(&self, machine: &LatticeMapper) -> Arc<OccupancyList> {
        let (state, store) = ((machine.epoch, machine.sequence), machine.cells());
        let mut copy = lock(&self.copy);
        match &*copy {
            Some(copy) if copy.state == state => Arc::clone(&copy.cells),
            _ => {
                let (lattice, datum) = (store.lattice().clone(), store.datum_index());
                let keys = store.sorted_keys();
                let cells = Arc::new(OccupancyList::from_keys(lattice, datum, keys, usize::MAX));
                *copy = Some(Copied {
                    state,
                    cells: Arc::clone(&cells),
                });
                cells
            }
        }
    }
}

/// Reply without a search.
pub(super) fn failed(why: impl ToString) -> PlanPathResponse {
    PlanPathResponse {
        message: why.to_string(),
        ..PlanPathResponse::default()
    }
}

/// Searches a path; stops once `go_on` returns false.
fn plan(
    store: &impl VoxelStore,
    request: &PlanPathRequest,
    go_on: impl FnMut() -> bool,
) -> PlanPathResponse {
    match find(store, request, go_on) {
        Ok(path) => PlanPathResponse {
            success: true,
            message: format!("{:.2} m, {} cells expanded", path.length_m, path.expanded),
            length_m: path.length_m,
            path: path.centers_m.iter().map(point).collect(),
        },
        Err(why) => failed(why),
    }
}

fn find(
    store: &impl VoxelStore,
    request: &PlanPathRequest,
    go_on: impl FnMut() -> bool,
) -> Result<Path, String> {
    let &PlanPathRequest {
        radius_m,
        tolerance_m,
        ..
    } = request;
    for (name, distance_m) in [("radius", radius_m), ("tolerance", tolerance_m)] {
        let cells = 4.0 / 3.0 * std::f64::consts::PI * distance_m.powi(3)
            / store.lattice().cell_volume_m3();
        if cells > MAX_BALL_CELLS {
            let problem = format!("{name} of {distance_m} m: a ball of {cells:.0} cells");
            return Err(format!("{problem}, more than {MAX_BALL_CELLS}"));
        }
    }
    let query = Query::new(store);
    let end = |name: &str, point: &Point| {
        let point_m = vector(point);
        if tolerance_m == 0.0 {
            return Ok(point_m);
        }
        let place = query.nearest_passable(&point_m, radius_m, tolerance_m);
        place.map_err(words)?.ok_or_else(|| {
            let at = format!("[{:.2}, {:.2}, {:.2}]", point.x, point.y, point.z);
            format!("no room for radius {radius_m} m within {tolerance_m} m of {name} {at}")
        })
    };
    let (start_m, goal_m) = (end("start", &request.start)?, end("goal", &request.goal)?);
    let options = PathOptions {
        radius_m,
        steps: Steps::Touching,
        bounds: None,
        max_expanded: MAX_EXPANDED,
    };
    let path = query.straight_path_while(&start_m, &goal_m, &options, go_on);
    path.map_err(|error| match error {
        PathError::Limit { expanded } => {
            format!("no path found after {expanded} cells: the search limit is reached")
        }
        error => error.to_string(),
    })
}

fn point(center_m: &Vector3<f64>) -> Point {
    let [x, y, z] = (*center_m).into();
    Point { x, y, z }
}

fn words(error: PathError) -> String {
    error.to_string()
}

#[cfg(test)]
mod tests {
    use lattice_core::lattice::{Lattice, LatticeKind};
    use lattice_core::voxels::VoxelList;

    use super::*;

    /// A wall across x = 0 of 8 m by 8 m.
    fn wall() -> VoxelList {
        let lattice = Lattice::new(LatticeKind::Fcc, 0.008).unwrap();
        let mut list = VoxelList::new(lattice, Vector3::zeros(), 100_000).unwrap();
        let offsets_m = (0..6400).map(|i| {
            [
                0.0,
                (i % 80) as f32 * 0.1 - 4.0,
                (i / 80) as f32 * 0.1 - 4.0,
            ]
        });
        list.insert(&lattice_core::cloud::Cloud {
            stamp_ns: 1,
            datum_m: Vector3::zeros(),
            offsets_m: offsets_m.collect(),
        });
        list
    }

    fn request(start: [f64; 3], goal: [f64; 3]) -> PlanPathRequest {
        PlanPathRequest {
            start: point(&start.into()),
            goal: point(&goal.into()),
            radius_m: 0.3,
            tolerance_m: 0.0,
        }
    }

    #[test]
    fn a_path_goes_around_the_wall_from_end_to_end() {
        let wall = wall();
        let asked = request([-1.0, 3.0, 0.0], [1.0, 3.0, 0.0]);
        let answer = plan(&wall, &asked, || true);
        assert!(
            answer.success && answer.length_m > 2.5,
            "{}",
            answer.message
        );
        let query = Query::new(&wall);
        let ends = [&answer.path[0], answer.path.last().unwrap()];
        for (end, asked) in ends.iter().zip([&asked.start, &asked.goal]) {
            assert_eq!(wall.key_of(&vector(end)), wall.key_of(&vector(asked)));
        }
        for pair in answer.path.windows(2) {
            let [from_m, to_m] = [&pair[0], &pair[1]].map(vector);
            let line = lattice_core::query::Segment { from_m, to_m };
            assert!(query.is_free(&line, 0.3 - 1e-6).unwrap());
        }
    }

    #[test]
    fn an_occupied_end_is_refused_or_moves_as_far_as_it_may() {
        let wall = wall();
        let mut asked = request([0.0, 3.0, 0.0], [1.0, 3.0, 0.0]);
        let refused = plan(&wall, &asked, || true);
        assert!(
            !refused.success && refused.message.contains("start"),
            "{}",
            refused.message
        );
        asked.tolerance_m = 0.2;
        let refused = plan(&wall, &asked, || true);
        assert!(
            refused.message.contains("within 0.2 m of start"),
            "{}",
            refused.message
        );
        asked.tolerance_m = 0.8;
        let moved = plan(&wall, &asked, || true);
        assert!(moved.success, "{}", moved.message);
        let by_m = (vector(&moved.path[0]) - vector(&asked.start)).norm();
        assert!((0.3..0.9).contains(&by_m), "{by_m}");
    }

    #[test]
    fn searches_are_bounded_and_what_makes_no_sense_is_refused() {
        let wall = wall();
        let far = request([-1.0, 3.0, 0.0], [1.0, 3.0, 0.0]);
        let mut asked = 0;
        let stopped = plan(&wall, &far, || {
            asked += 1;
            asked <= 7
        });
        assert!(
            stopped.message.contains("7 cells: the search limit"),
            "{}",
            stopped.message
        );
        for bad in [f64::NAN, -1.0, 1e3, f64::INFINITY] {
            for (radius_m, tolerance_m) in [(bad, 0.1), (0.1, bad)] {
                let asked = PlanPathRequest {
                    radius_m,
                    tolerance_m,
                    ..far
                };
                assert!(!plan(&wall, &asked, || true).success, "{bad}");
            }
        }
        assert!(!plan(&wall, &request([f64::NAN; 3], [0.0; 3]), || true).success);
    }
}
