//! ROS node around [`MapMerger`].

use std::collections::BTreeMap;

use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};
use lattice_msgs::vision_msgs::{LabelInfo, VisionClass};
use lattice_runtime::logging::Throttle;
use lattice_runtime::qos::Qos;
use lattice_runtime::{Diagnostics, Level, Node, Publisher, Runtime, Subscription, Undecoded};
use serde::Serialize;

use super::parameters::Settings;
use super::{MapMerger, MergedLabels, MergerCounts, MergerOptions};
use crate::compute::Compute;
use crate::convert::geometry;
use crate::hurry::Hurry;
use crate::map_input::{MapLosses, MapRequests};
use crate::map_output::{MapOutput, epoch};
use crate::report;
use crate::start::{Finish, LAST_EVENTS, NodeError, ONCE_A_SECOND, handed_over, open_params};

/// Event for the compute thread.
enum Event {
    /// Map chunk of a robot, by its index in the options.
    Map(usize, Undecoded<LatticeMap>),
    Update(usize, Undecoded<LatticeMapUpdate>),
    Publish,
    Settings(MergerOptions),
    Finish,
}

/// Report of a run.
#[derive(Serialize)]
struct MergerReport<'a> {
    counts: &'a MergerCounts,
    voxels: usize,
    robots: Vec<(&'a str, usize)>,
    /// Changed voxels of robots that the merged map lacks.
    voxels_not_merged: usize,
    /// Lost messages per robot.
    #[serde(flatten)]
    losses: BTreeMap<String, u64>,
    updates_not_published: u64,
    chunks_not_published: u64,
}

/// Starts the node.
pub fn start(runtime: &Runtime, name: &str) -> Result<Finish, NodeError> {
    let node = runtime.node(name)?;
    let params = node.params();
    let settings = Settings::from_params(params)?;
    let robots = settings.merger.robots.clone();
    let hurry = Hurry::default();
    let (output, requests) = MapOutput::open(&node, &hurry)?;
    let label_info = match settings.merger.labels {
        MergedLabels::Robots => Some(names(&node, &settings.merger)?),
        MergedLabels::Own | MergedLabels::None => None,
    };
    let losses: Vec<MapLosses> = robots.iter().map(|_| MapLosses::default()).collect();
    let input = |(robot, losses): (&String, &MapLosses)| {
        let mapper = format!("/{robot}/{}", settings.mapper);
        MapRequests::new(&node, &mapper, losses)
    };
    let mut compute_state = ComputeState {
        inputs: robots
            .iter()
            .zip(&losses)
            .map(input)
            .collect::<Result<_, _>>()?,
        hurry: hurry.clone(),
        machine: MapMerger::new(settings.merger, epoch()).hurried_by(&hurry),
        robots: robots.clone(),
        output,
        diagnostics: node.diagnostics(),
        seconds: Throttle::new(ONCE_A_SECOND),
        report_file: settings.report_file,
    };
    let compute = Compute::spawn(
        name,
        settings.limits,
        runtime.shutdown_handle(),
        move |event| compute_state.on(event),
    )?;
    let inbox = compute.inbox();
    let mut subscriptions: Vec<[Subscription; 2]> = Vec::new();
    for (i, (robot, losses)) in robots.iter().zip(&losses).enumerate() {
        let topics = [
            format!("/{robot}/voxel_map"),
            format!("/{robot}/voxel_map_updates"),
        ];
        let map = move |chunk| Event::Map(i, chunk);
        let update = move |chunk| Event::Update(i, chunk);
        subscriptions.push(losses.subscribe_to(&node, topics, &inbox, map, update)?);
    }
    let period = inbox.ticks((runtime, &node), settings.period, || Event::Publish);
    open_params(params, move |params| {
        let settings = Settings::from_params(params).map_err(|error| error.to_string())?;
        handed_over(inbox.send(Event::Settings(settings.merger), 0))?;
        period.set(settings.period);
        Ok(())
    });
    Ok(Box::new(move || {
        drop(subscriptions);
        compute.finish_within(Event::Finish, LAST_EVENTS, || hurry.request());
        Box::new((requests, label_info))
    }))
}

/// Latched publisher of the robots' names.
fn names(node: &Node, options: &MergerOptions) -> Result<Publisher<LabelInfo>, NodeError> {
    let classes = (0..)
        .zip(&options.robots)
        .map(|(class_id, name)| VisionClass {
            class_id,
            class_name: name.clone(),
        });
    let publisher = node.publisher("label_info", Qos::LATCHED)?;
    publisher.publish(LabelInfo {
        header: geometry::header(&options.map_frame, 0),
        class_map: classes.collect(),
        threshold: 0.0,
    })?;
    Ok(publisher)
}

/// State of the compute thread.
struct ComputeState {
    inputs: Vec<MapRequests>,
    hurry: Hurry,
    machine: MapMerger,
    robots: Vec<String>,
    output: MapOutput,
    diagnostics: Diagnostics,
    seconds: Throttle,
    report_file: String,
}

impl ComputeState {
    fn on(&mut self, event: Event) {
        match event {
            Event::Map(robot, chunk) => {
                if let Some(input) = self.inputs.get_mut(robot) {
                    input.map(chunk, |chunk| self.machine.on_map(robot, chunk));
                }
            }
            Event::Update(robot, chunk) => {
                if let Some(input) = self.inputs.get_mut(robot) {
                    input.update(chunk, |chunk| self.machine.on_update(robot, chunk));
                }
            }
            Event::Publish => self.publish(),
            Event::Settings(options) => self.machine.set_options(options),
            Event::Finish => self.finish(),
        }
    }

    fn publish(&mut self) {
        self.inputs.iter_mut().for_each(MapRequests::make_good);
        if self.seconds.check().is_some() {
            for robot in self.machine.check_keyframe_timeout() {
                if let Some(input) = self.inputs.get(robot) {
                    input.ask_for_keyframe();
                }
            }
        }
        let hurry = &self.hurry;
        let update = self.machine.take_update_until(&|| hurry.is_requested());
        // Before the first robot there is no map to publish.
        if self.machine.list().is_some() {
            self.output.publish(update, || self.machine.keyframe());
        }
        self.diagnose();
    }

    fn diagnose(&self) {
        let robot_maps = || self.robots.iter().zip(self.machine.robot_maps());
        let refused =
            robot_maps().find_map(|(robot, robot_map)| Some((robot, robot_map.refusal()?)));
        let silent: Vec<&str> = robot_maps()
            .filter(|(_, robot_map)| robot_map.voxels() == 0)
            .map(|(robot, _)| robot.as_str())
            .collect();
        let counts = self.machine.counts();
        let (level, message) = if let Some((robot, refusal)) = refused {
            (
                Level::Error,
                format!("the map of {robot} is not merged: {refusal}"),
            )
        } else if counts.voxels_list_full > 0 {
            (Level::Warn, "the list is full (`max_voxels`)".to_owned())
        } else if !silent.is_empty() {
            (Level::Warn, format!("no voxels of {}", silent.join(", ")))
        } else {
            (Level::Ok, "merging".to_owned())
        };
        let mut values = report::key_values(counts);
        for (robot, robot_map) in robot_maps() {
            values.push((format!("{robot}_voxels"), robot_map.voxels().to_string()));
        }
        let losses = self.losses().into_iter();
        values.extend(losses.map(|(key, count)| (key, count.to_string())));
        values.push(("voxels".into(), self.voxels().to_string()));
        self.diagnostics.set("merged map", level, message, values);
    }

    /// Lost messages of each robot.
    fn losses(&self) -> BTreeMap<String, u64> {
        let inputs = self.robots.iter().zip(&self.inputs);
        let losses = inputs.flat_map(|(robot, input)| {
            let losses = input.losses();
            let counts = [
                ("inbox_full", losses.inbox_full()),
                ("lost_on_network", losses.on_network()),
                ("undecodable", losses.undecodable()),
            ];
            counts.map(|(reason, count)| (format!("{robot}_{reason}"), count))
        });
        losses.collect()
    }

    fn voxels(&self) -> usize {
        self.machine.list().map_or(0, |list| list.len())
    }

    fn finish(&mut self) {
        self.publish();
        let mut left = usize::MAX;
        while self.output.pending() > 0 && self.output.pending() < left {
            left = self.output.pending();
            self.publish();
        }
        let voxels_not_merged = self.machine.waiting();
        if voxels_not_merged > 0 {
            log::warn!("the node ends before it has merged {voxels_not_merged} voxels");
        }
        self.output.flush();
        let robot_maps = self.robots.iter().zip(self.machine.robot_maps());
        let report = MergerReport {
            counts: self.machine.counts(),
            voxels: self.voxels(),
            robots: robot_maps
                .map(|(robot, robot_map)| (robot.as_str(), robot_map.voxels()))
                .collect(),
            voxels_not_merged,
            losses: self.losses(),
            updates_not_published: self.output.updates_lost(),
            chunks_not_published: self.output.chunks_lost(),
        };
        if let Err(error) = report::write(&self.report_file, &report, &self.diagnostics) {
            log::error!("{error}");
        }
    }
}
