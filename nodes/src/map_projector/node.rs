//! ROS node around [`MapProjector`].

use std::sync::Arc;
use std::time::{Duration, Instant};

use lattice_msgs::nav2_msgs::ComputePathToPoseAction;

use super::diagnosis::diagnosis;
use super::inputs::{Event, Inputs};
use super::outputs::Outputs;
use super::parameters::Settings;
use super::planner::Planner;
use super::robot::RobotPosition;
use super::{MapProjector, Projected, ProjectorReport};
use crate::compute::Compute;
use crate::hurry::Hurry;
use crate::map_input::{MapLosses, MapRequests};
use crate::report;
use crate::start::{
    Finish, LAST_EVENTS, LAST_FLUSH, NodeError, ONCE_A_SECOND, handed_over, open_params,
};
use lattice_runtime::logging::Throttle;
use lattice_runtime::qos::Qos;
use lattice_runtime::{ActionLimits, Activity, Diagnostics, Runtime};

/// Time without a subscriber after which the map is no longer followed.
const IDLE: Duration = Duration::from_secs(10);

/// Starts the node.
pub fn start(runtime: &Runtime, name: &str) -> Result<Finish, NodeError> {
    let node = runtime.node(name)?;
    let params = node.params();
    let settings = Settings::from_params(params)?;
    let outputs = Outputs::new(&node, settings.projector.has_ground())?;
    let (losses, hurry) = (MapLosses::default(), Hurry::default());
    let requests = MapRequests::new(&node, &settings.mapper, &losses)?;
    let planner = match settings.plan {
        true => {
            let path = node.publisher("plan", Qos::DEFAULT)?;
            Some(Planner::new(settings.path, path, node.clock()))
        }
        false => None,
    };
    let mut state = ComputeState {
        activity: node.activity(),
        requests,
        planner,
        draws: false,
        robot: RobotPosition::new(settings.base_frame),
        needs_free: !settings.projector.has_ground(),
        machine: MapProjector::new(settings.projector).hurried_by(&hurry),
        outputs: outputs.clone(),
        diagnostics: node.diagnostics(),
        seconds: Throttle::new(ONCE_A_SECOND),
        inputs: None,
        wanted: Instant::now(),
        grid_period: settings.grid_period,
        grid_due: None,
        refused: 0,
        report_file: settings.report_file,
    };
    let compute = Compute::spawn(
        name,
        settings.limits,
        runtime.shutdown_handle(),
        move |event| state.on(event),
    )?;
    let inbox = compute.inbox();
    let inputs = Inputs {
        node: node.clone(),
        inbox: inbox.clone(),
        losses,
        open: Vec::new(),
    };
    handed_over(inbox.send(Event::Inputs(Box::new(inputs)), 0))?;
    let joined = inbox.clone();
    outputs.grid.on_subscriber_joined(move || {
        let _ = joined.send(Event::Joined, 0);
    });
    if let Some(elevation) = &outputs.elevation {
        let joined = inbox.clone();
        elevation.on_subscriber_joined(move || {
            let _ = joined.send(Event::ElevationJoined, 0);
        });
    }
    let action = match settings.plan {
        true => {
            let (goals, canceled) = (inbox.clone(), inbox.clone());
            let action = node.action_server::<ComputePathToPoseAction>(
                "compute_path_to_pose",
                ActionLimits::default(),
                move |goal, handle| goals.send(Event::Goal(Box::new(goal), handle), 0),
                move |_| {
                    let _ = canceled.send(Event::Plan, 0);
                },
            )?;
            Some(Arc::new(action))
        }
        false => None,
    };
    let goals = action.clone();
    let period = inbox.ticks((runtime, &node), settings.update_period, move || {
        if let Some(goals) = &goals {
            goals.expire();
        }
        Event::Project
    });
    open_params(params, move |params| {
        let settings = Settings::from_params(params).map_err(|error| error.to_string())?;
        let update_period = settings.update_period;
        handed_over(inbox.send(Event::Settings(Box::new(settings)), 0))?;
        period.set(update_period);
        Ok(())
    });
    Ok(Box::new(move || {
        compute.finish_within(Event::Finish, LAST_EVENTS, || hurry.request());
        Box::new(action)
    }))
}

/// State of the compute thread.
struct ComputeState {
    activity: Activity,
    requests: MapRequests,
    machine: MapProjector,
    robot: RobotPosition,
    needs_free: bool,
    outputs: Outputs,
    planner: Option<Planner>,
    /// True once somebody has subscribed to grid or elevation since the map is followed.
    draws: bool,
    diagnostics: Diagnostics,
    seconds: Throttle,
    inputs: Option<Inputs>,
    /// Last time at which somebody subscribed to an output, or wanted a path.
    wanted: Instant,
    grid_period: Duration,
    /// Time of the next whole grid, if one is due for a subscriber without updates.
    grid_due: Option<Instant>,
    /// Transforms rejected.
    refused: u64,
    report_file: String,
}

impl ComputeState {
    fn on(&mut self, event: Event) {
        match event {
            Event::Inputs(inputs) => self.inputs = Some(*inputs),
            Event::Map(chunk) => {
                self.requests.map(chunk, |chunk| self.machine.on_map(chunk));
            }
            Event::Update(chunk) => {
                self.requests
                    .update(chunk, |chunk| self.machine.on_update(chunk));
            }
            Event::Free(chunk) => {
                // Free cells are published anew by themselves.
                let _ = chunk.decode().map(|chunk| self.machine.on_free(&chunk));
            }
            Event::Transforms(message, is_static) => {
                self.refused += self.robot.on_tf(&message, is_static);
            }
            Event::Goal(goal, handle) => {
                if let Some(planner) = &mut self.planner {
                    planner.add(goal, handle);
                }
                self.follow_by_demand();
                self.plan();
            }
            Event::Plan => self.plan(),
            Event::Joined => {
                self.follow_by_demand();
                self.grid_due = Some(Instant::now());
                self.project();
            }
            Event::ElevationJoined => {
                self.follow_by_demand();
                // Made anew: it may take no messages of before.
                self.machine.draw_elevation(false);
                self.project();
            }
            Event::Project => {
                self.follow_by_demand();
                self.requests.make_good();
                if self.seconds.check().is_some() && self.machine.check_keyframe_timeout() {
                    self.requests.ask_for_keyframe();
                }
                self.project();
                self.plan();
                self.diagnose();
            }
            Event::Settings(settings) => {
                self.machine.set_options(settings.projector);
                self.grid_period = settings.grid_period;
                if let Some(planner) = &mut self.planner {
                    planner.set_options(settings.path);
                }
            }
            Event::Finish => self.finish(),
        }
    }

    /// Subscribes to the map while somebody subscribes to an output, or wants a path.
    fn follow_by_demand(&mut self) {
        let Some(inputs) = &mut self.inputs else {
            return;
        };
        let subscribers = self.outputs.subscribers();
        self.draws |= subscribers > 0;
        if subscribers > 0 || self.planner.as_ref().is_some_and(Planner::is_wanted) {
            self.wanted = Instant::now();
            if inputs.open.is_empty() {
                match inputs.open(self.needs_free) {
                    // Within a process no keyframe comes by itself.
                    Ok(()) => self.requests.ask_for_keyframe(),
                    Err(error) => log::warn!("the map is not followed: {error}"),
                }
            }
        } else if !inputs.open.is_empty() && self.wanted.elapsed() > IDLE {
            inputs.open.clear();
            self.machine.clear();
            self.draws = false;
        }
    }

    /// Serves the goals of the planner.
    fn plan(&mut self) {
        let (Some(planner), Some(inputs)) = (&mut self.planner, &self.inputs) else {
            return;
        };
        let inbox = inputs.inbox.clone();
        planner.serve(&mut self.machine, &self.robot, move || {
            let _ = inbox.send(Event::Plan, 0);
        });
    }

    /// Publishes what changed.
    fn project(&mut self) {
        if !self.draws {
            return;
        }
        let robot_m = self
            .machine
            .map_frame()
            .and_then(|frame| self.robot.in_frame(frame));
        if let Some(robot_m) = robot_m {
            self.machine.set_robot(robot_m);
        }
        let draws_elevation = self.outputs.elevation_subscribers() > 0;
        self.machine.draw_elevation(draws_elevation);
        let change = self.machine.take_change();
        if let Some(elevation) = self.machine.take_elevation() {
            self.outputs.publish_elevation(elevation);
        }
        match change {
            None => {}
            Some(Projected::Grid(grid)) => {
                self.grid_due = None;
                self.outputs.publish_grid(grid);
            }
            Some(Projected::Updates(updates)) => {
                self.outputs.publish_updates(updates);
                let takes_no_updates =
                    self.outputs.grid.subscriber_count() > self.outputs.updates.subscriber_count();
                if takes_no_updates && self.grid_due.is_none() {
                    self.grid_due = Some(Instant::now() + self.grid_period);
                }
            }
        }
        if self.grid_due.is_some_and(|due| due <= Instant::now()) {
            self.publish_whole();
        }
        if self.grid_due.is_some() {
            self.activity.note();
        }
    }

    fn publish_whole(&mut self) {
        self.grid_due = None;
        if let Some(grid) = self.machine.whole_grid() {
            self.outputs.publish_grid(grid);
        }
    }

    fn report(&self) -> ProjectorReport {
        let losses = self.requests.losses();
        ProjectorReport {
            counts: self.machine.counts().clone(),
            voxels: self.machine.voxels(),
            cells: self.machine.cells(),
            grids_not_published: self.outputs.dropped(),
            inbox_full: losses.inbox_full(),
            lost_on_network: losses.on_network(),
            undecodable: losses.undecodable(),
            transforms_refused: self.refused,
            plans: self
                .planner
                .as_ref()
                .map(Planner::counts)
                .unwrap_or_default(),
        }
    }

    fn diagnose(&self) {
        let report = self.report();
        let is_followed = self
            .inputs
            .as_ref()
            .is_some_and(|inputs| !inputs.open.is_empty());
        let (level, message) = diagnosis(&self.machine, &report, is_followed, self.draws);
        let mut values = report::key_values(&report);
        let differences = self.machine.map_differences();
        values.push(("map_differences".into(), differences.to_string()));
        self.diagnostics.set("grid", level, message, values);
    }

    fn finish(&mut self) {
        self.project();
        self.outputs.flush(LAST_FLUSH);
        self.inputs = None;
        if let Err(error) = report::write(&self.report_file, &self.report(), &self.diagnostics) {
            log::error!("{error}");
        }
        // Its search ends with it.
        self.planner = None;
    }
}
