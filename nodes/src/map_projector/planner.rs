//! Goals of the action, one after another, on a thread for each search.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use lattice_core::navigation::{GroundMap, GroundPathOptions};
use lattice_msgs::geometry_msgs::PoseStamped;
use lattice_msgs::nav_msgs::Path;
use lattice_msgs::nav2_msgs::{
    ComputePathToPoseAction, ComputePathToPoseGoal, ComputePathToPoseResult,
};
use lattice_runtime::{Clock, GoalHandle, Publisher};
use nalgebra::Isometry3;

use super::machine::MapProjector;
use super::plan::{PlanFailure, PlanRequest, plan};
use super::plan_counts::PlanCounts;
use super::robot::RobotPosition;
use crate::convert::geometry;

/// Time limit of a search, without the time in which the surfaces of the map are found.
const SEARCH_TIME: Duration = Duration::from_secs(3);
/// Time for which a goal waits for the map and transforms.
const INPUT_TIME: Duration = Duration::from_secs(10);

/// Characters of a client's name that are repeated in a text.
const MOST_NAMED: usize = 64;

/// State shared with the thread of a search.
#[derive(Default)]
struct Shared {
    busy: AtomicBool,
    found: AtomicU64,
    failed: AtomicU64,
    canceled: AtomicU64,
}

/// A goal with its client and its time.
struct Waiting {
    goal: Box<ComputePathToPoseGoal>,
    handle: GoalHandle<ComputePathToPoseAction>,
    since: Instant,
}

/// Planner of a node; its search ends with it.
pub(super) struct Planner {
    options: GroundPathOptions,
    path: Publisher<Path>,
    clock: Clock,
    waiting: VecDeque<Waiting>,
    shared: Arc<Shared>,
    /// True once an identifier of another planner was logged.
    named: bool,
}

impl Planner {
    pub(super) fn new(options: GroundPathOptions, path: Publisher<Path>, clock: Clock) -> Self {
        Self {
            options,
            path,
            clock,
            waiting: VecDeque::new(),
            shared: Arc::default(),
            named: false,
        }
    }

    pub(super) fn set_options(&mut self, options: GroundPathOptions) {
        self.options = options;
    }

    /// Adds a goal.
    pub(super) fn add(
        &mut self,
        goal: Box<ComputePathToPoseGoal>,
        handle: GoalHandle<ComputePathToPoseAction>,
    ) {
        if !goal.planner_id.is_empty() && !self.named {
            self.named = true;
            let id: String = goal.planner_id.chars().take(MOST_NAMED).collect();
            log::info!("planner_id {id} makes no difference: this node has one planner");
        }
        self.waiting.push_back(Waiting {
            goal,
            handle,
            since: Instant::now(),
        });
    }

    /// True while a goal has not ended.
    pub(super) fn is_wanted(&self) -> bool {
        !self.waiting.is_empty() || self.shared.busy.load(Ordering::Acquire)
    }

    /// Ends canceled goals, and begins the search of the next one once map and transforms are there; `wake` is called at
    /// the end of a search.
    pub(super) fn serve(
        &mut self,
        machine: &mut MapProjector,
        robot: &RobotPosition,
        wake: impl FnOnce() + Send + 'static,
    ) {
        for waiting in std::mem::take(&mut self.waiting) {
            match waiting.handle.is_canceled() {
                true => self.shared.cancel(waiting.handle, waiting.since),
                false => self.waiting.push_back(waiting),
            }
        }
        if self.shared.busy.load(Ordering::Acquire) {
            return;
        }
        let Some(next) = self.waiting.pop_front() else {
            return;
        };
        match self.request(&next, machine, robot) {
            Ok((ground, request)) => self.begin(ground, request, next.handle, wake),
            Err(failure) if failure.is_missing && next.since.elapsed() < INPUT_TIME => {
                self.waiting.push_front(next);
            }
            Err(failure) => self.shared.fail(next.handle, failure, next.since),
        }
    }

    /// The ground and the request of a goal; an error while something is missing.
    fn request(
        &self,
        waiting: &Waiting,
        machine: &mut MapProjector,
        robot: &RobotPosition,
    ) -> Result<(GroundMap, PlanRequest), PlanFailure> {
        type Codes = ComputePathToPoseResult;
        let goal = &waiting.goal;
        let missing = |text: &str| PlanFailure::missing(Codes::UNKNOWN, text);
        let frame = machine.map_frame().map(str::to_owned);
        let frame = frame.ok_or_else(|| missing("no map was received: is the mapper running?"))?;
        let in_map = |stamped: &PoseStamped| -> Result<Isometry3<f64>, PlanFailure> {
            let from = &stamped.header.frame_id;
            let map_from_frame = match from.is_empty() || *from == frame {
                true => Some(Isometry3::identity()),
                false => robot.pose_of(from, &frame),
            };
            let no_tf = || {
                let from: String = from.chars().take(MOST_NAMED).collect();
                let text =
                    format!("no transform from {from} to {frame}: check /tf, or plan in {frame}");
                PlanFailure::missing(Codes::TF_ERROR, text)
            };
            let pose = geometry::isometry_from_pose(&stamped.pose);
            let bad = "a pose is not finite, or its orientation is zero";
            let bad = || PlanFailure::new(Codes::UNKNOWN, bad);
            Ok(map_from_frame.ok_or_else(no_tf)? * pose.ok_or_else(bad)?)
        };
        let start_m = match goal.use_start {
            true => Some(in_map(&goal.start)?.translation.vector),
            false => robot.in_frame(&frame),
        };
        let start_m = start_m.ok_or_else(|| {
            let text =
                format!("no transform from base_frame to {frame}: check /tf, or set use_start");
            PlanFailure::missing(Codes::TF_ERROR, text)
        })?;
        let goal = in_map(&goal.goal)?;
        let begun = Instant::now();
        let ground = machine.ground_map();
        let ground = ground.ok_or_else(|| missing("the map is incomplete: plan again"))??;
        let request = PlanRequest {
            start_m,
            goal,
            header: geometry::header(&frame, self.clock.now_ns()),
            options: self.options,
            begun,
        };
        Ok((ground, request))
    }

    fn begin(
        &self,
        ground: GroundMap,
        request: PlanRequest,
        handle: GoalHandle<ComputePathToPoseAction>,
        wake: impl FnOnce() + Send + 'static,
    ) {
        self.shared.busy.store(true, Ordering::Release);
        handle.execute();
        let (shared, path) = (Arc::clone(&self.shared), self.path.clone());
        let search = move || {
            let (begun, searching) = (request.begun, Instant::now());
            let is_wanted = || !handle.is_canceled() && Arc::strong_count(&shared) > 1;
            let go_on = || searching.elapsed() < SEARCH_TIME && is_wanted();
            let found = plan(&ground, &request, go_on);
            match found {
                _ if handle.is_canceled() => shared.cancel(handle, begun),
                Ok(result) => {
                    shared.found.fetch_add(1, Ordering::Relaxed);
                    if let Err(error) = path.publish(result.path.clone()) {
                        log::debug!("path not published: {error}");
                    }
                    handle.succeed(result);
                }
                Err(failure) => shared.fail(handle, failure, begun),
            }
            shared.busy.store(false, Ordering::Release);
            wake();
        };
        let thread = thread::Builder::new().name("plan path".to_owned());
        if let Err(error) = thread.spawn(search) {
            // The goal was dropped with the closure, which aborts it.
            log::warn!("a goal was aborted: {error}");
            self.shared.failed.fetch_add(1, Ordering::Relaxed);
            self.shared.busy.store(false, Ordering::Release);
        }
    }

    /// Goals by their ends.
    pub(super) fn counts(&self) -> PlanCounts {
        let count = |count: &AtomicU64| count.load(Ordering::Relaxed);
        PlanCounts {
            plans_out: count(&self.shared.found),
            plans_failed: count(&self.shared.failed),
            plans_canceled: count(&self.shared.canceled),
        }
    }
}

impl Shared {
    fn fail(
        &self,
        handle: GoalHandle<ComputePathToPoseAction>,
        failure: PlanFailure,
        begun: Instant,
    ) {
        self.failed.fetch_add(1, Ordering::Relaxed);
        log::info!("no path: {}", failure.text);
        handle.abort(failure.result(begun));
    }

    fn cancel(&self, handle: GoalHandle<ComputePathToPoseAction>, begun: Instant) {
        self.canceled.fetch_add(1, Ordering::Relaxed);
        let text = "canceled by a client";
        handle.cancel(PlanFailure::new(ComputePathToPoseResult::NONE, text).result(begun));
    }
}
