//! ROS node around [`LatticeMapper`].

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Once};
use std::time::Duration;

use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_msgs::vision_msgs::LabelInfo;

use super::autosave::Autosave;
use super::call::Call;
use super::compute_state::{ComputeState, NO_VIEWPOINTS, UpdateRequests};
use super::corrected::CorrectedDrive;
use super::octomap::{self, Octomaps};
use super::options::MapperOptions;
use super::outputs::Outputs;
use super::parameters::Settings;
use super::services;
use super::state::LatticeMapper;
use super::unmapped::Unmapped;
use crate::compute::Compute;
use crate::convert::cloud;
use crate::hurry::Hurry;
use crate::map_output::{MapOutput, epoch};
use crate::report;
use crate::start::{Finish, LAST_EVENTS, NodeError, handed_over, open_params};
use lattice_runtime::logging::Throttle;
use lattice_runtime::qos::Qos;
use lattice_runtime::{Losses, Runtime, SubscriptionExecutor, lock};

/// Event for the compute thread.
enum Event {
    Cloud(Arc<PointCloud2>),
    Corrections(Arc<TFMessage>),
    Update,
    Centers,
    Free,
    Autosave,
    Settings(Box<MapperOptions>, Duration),
    Reset,
    Call(Call),
    Finish,
}

/// Starts the node.
pub fn start(runtime: &Runtime, name: &str) -> Result<Finish, NodeError> {
    let node = runtime.node(name)?;
    let params = node.params();
    let settings = Settings::from_params(params)?;
    let (maps, old) = (settings.maps, settings.mapper.clone());
    let lost = Arc::new(AtomicU64::new(0));
    let (clouds, inputs) = (Losses::default(), Losses::default());
    let update_requests = Arc::new(UpdateRequests::default());
    let max_voxels = Arc::new(AtomicUsize::new(old.voxel_limit()));
    let hurry = Hurry::default();
    let mut machine = LatticeMapper::new(settings.mapper, epoch())?.hurried_by(&hurry);
    let (output, requests) = MapOutput::open(&node, &hurry)?;
    (settings.initial_map).load(&maps, &mut machine, old.voxel_limit())?;
    let autosave = Autosave::new(
        settings.autosave,
        &maps,
        &machine,
        runtime.shutdown_handle(),
    );
    let autosave_period = autosave.period;
    let max_kept_bytes = settings.max_kept_bytes;
    let drive = max_kept_bytes.map(|max_bytes| CorrectedDrive::new(&machine, max_bytes));
    let mut compute_state = ComputeState {
        activity: node.activity(),
        drive,
        machine,
        autosave,
        output,
        octomaps: (settings.octomap_services.then(|| Octomaps::open(&node))).transpose()?,
        outputs: Outputs::open(&node, old.free_space.free_level > 0)?,
        diagnostics: node.diagnostics(),
        unmapped: Some(Unmapped::new(node.resolve("points_enu")?)),
        lost: Arc::clone(&lost),
        clouds: clouds.clone(),
        inputs: inputs.clone(),
        refusals: Throttle::new(Duration::from_secs(5)),
        no_viewpoints: Once::new(),
        update_requests: Arc::clone(&update_requests),
        writing: None,
        maps: maps.clone(),
        centers_of: None,
        report_file: settings.report_file,
    };
    let centers = compute_state.outputs.centers.clone();
    let compute = Compute::spawn(
        name,
        settings.limits,
        runtime.shutdown_handle(),
        move |event| compute_state.on(event),
    )?;
    let inbox = compute.inbox();
    let hand_over = inbox.counting(&lost, Event::Cloud, |cloud| cloud::bytes_of(cloud));
    let points = node.subscribe(
        "points_enu",
        Qos::SCANS,
        SubscriptionExecutor::Dedicated,
        hand_over,
    )?;
    let origins = Arc::clone(&update_requests);
    let take = move |origin| *lock(&origins.origin) = Some(origin);
    let origins = node.subscribe(
        "map_origin",
        Qos::LATCHED,
        SubscriptionExecutor::Shared,
        take,
    )?;
    let corrections = match max_kept_bytes {
        Some(_) => {
            let inbox = inbox.clone();
            let hand_over = move |message: Arc<TFMessage>| {
                if !inbox.send(Event::Corrections(message), 0) {
                    log::warn!("the inbox is full: corrections are lost until the next ones");
                }
            };
            Some(node.subscribe(
                "corrections",
                Qos::LATCHED,
                SubscriptionExecutor::Shared,
                hand_over,
            )?)
        }
        None => None,
    };
    let names = match old.payload().labels {
        true => {
            let maps = maps.clone();
            let take = move |info: Arc<LabelInfo>| maps.name_labels(&info);
            Some(node.subscribe(
                "label_info",
                Qos::LATCHED,
                SubscriptionExecutor::Shared,
                take,
            )?)
        }
        false => None,
    };
    centers.on_subscriber_joined(move || update_requests.centers.store(true, Ordering::Relaxed));
    let services = inbox.clone();
    let mut more = Vec::new();
    match settings.octomap_services {
        true => more.extend(octomap::serve(&node, &services, Event::Call, || {
            Event::Reset
        })?),
        false => {
            more.push(node.service_trigger(
                "~/reset",
                move || match services.send(Event::Reset, 0) {
                    true => (true, "map emptied".into()),
                    false => (false, "the inbox of the node is full: call again".into()),
                },
            )?)
        }
    }
    clouds.watch([&points]);
    let is_enu = |topic: &str| topic.ends_with("/points_enu");
    node.expect_publishers([&points], "enu_transformer", None, is_enu);
    inputs.watch([&points, &origins, &requests.topic]);
    inputs.watch(&corrections);
    let calls = services::serve(&node, &inbox, Event::Call, maps, Arc::clone(&max_voxels))?;
    let timer = |period, event: fn() -> Event| inbox.ticks((runtime, &node), period, event);
    let updates = timer(settings.update_period, || Event::Update);
    let centers = timer(settings.centers_period, || Event::Centers);
    let free = timer(settings.free_period, || Event::Free);
    let autosave = timer(autosave_period, || Event::Autosave);
    open_params(params, move |params| {
        let settings = Settings::changed(params, &old).map_err(|error| error.to_string())?;
        let (limit, saves) = (settings.mapper.voxel_limit(), settings.autosave.period);
        handed_over(inbox.send(Event::Settings(Box::new(settings.mapper), saves), 0))?;
        max_voxels.store(limit, Ordering::Relaxed);
        updates.set(settings.update_period);
        centers.set(settings.centers_period);
        free.set(settings.free_period);
        autosave.set(saves);
        Ok(())
    });
    Ok(Box::new(move || {
        drop((points, origins, names, corrections));
        compute.finish_hurrying(Event::Finish, LAST_EVENTS, || hurry.request());
        Box::new((requests, more, calls))
    }))
}

impl ComputeState {
    fn on(&mut self, event: Event) {
        match event {
            Event::Cloud(cloud) => {
                let mapped = match &mut self.drive {
                    Some(drive) => drive.on_cloud(&mut self.machine, &cloud),
                    None => self.machine.on_cloud(&cloud),
                };
                if let Err(refusal) = mapped {
                    if let Some(more) = self.refusals.check() {
                        log::warn!("{refusal} ({more} more like it)");
                    }
                    if let Some(unmapped) = &mut self.unmapped {
                        unmapped.last_refusal = Some(refusal.to_string());
                    }
                }
                if self.machine.counts().clouds_no_viewpoint == 1 {
                    self.no_viewpoints
                        .call_once(|| log::warn!("{NO_VIEWPOINTS}"));
                }
            }
            Event::Corrections(message) => {
                let taken = self
                    .drive
                    .as_mut()
                    .map(|drive| drive.on_corrections(&message));
                if let Some(Err(error)) = taken
                    && let Some(more) = self.refusals.check()
                {
                    log::warn!("corrections rejected: {error} ({more} more like it)");
                }
            }
            Event::Update => self.update(),
            Event::Centers => self.centers(false),
            Event::Free => self.free(),
            Event::Autosave => self.autosave.save(&self.machine),
            Event::Settings(options, saves) => {
                self.machine.set_options(*options);
                self.autosave.period = saves;
            }
            Event::Reset => {
                self.machine.reset(epoch());
                self.replaced();
            }
            Event::Call(call) => {
                let done = services::answer(&mut self.machine, call, epoch(), &self.maps);
                if done.replaced {
                    self.replaced();
                }
                if let (Some(drive), Some(region)) = (&mut self.drive, &done.cleared) {
                    drive.remove(&self.machine, region);
                }
                self.writing = done.writing.or(self.writing.take());
            }
            Event::Finish => return self.finish(),
        }
        self.correct(false);
    }

    /// The map is another one, from a file or empty.
    fn replaced(&mut self) {
        self.output.replaced();
        if let Some(drive) = &mut self.drive {
            drive.restart(&self.machine);
        }
    }

    /// Makes the map anew where corrections move it.
    fn correct(&mut self, to_end: bool) {
        let Some(drive) = &mut self.drive else {
            return;
        };
        let corrected = match to_end {
            true => drive.finish(&mut self.machine, epoch),
            false => drive.step(&mut self.machine, epoch),
        };
        if drive.is_at_work() {
            self.activity.note();
        }
        match corrected {
            Ok(true) => self.output.replaced(),
            Ok(false) => {}
            Err(error) => log::error!("the map is not corrected: {error}"),
        }
    }

    /// Publishes an update, and a keyframe on request or after a lost update.
    fn update(&mut self) {
        if let Some(origin) = lock(&self.update_requests.origin).take() {
            self.machine.on_origin(&origin);
        }
        let update = self.machine.take_update();
        self.output.publish(update, || self.machine.keyframe());
        self.diagnose();
    }

    fn centers(&mut self, is_last: bool) {
        if let Some(octomaps) = &mut self.octomaps {
            octomaps.publish(&mut self.machine, is_last);
        }
        let state = self.machine.state();
        let asked = self.update_requests.centers.swap(false, Ordering::Relaxed);
        let listened = self.outputs.centers.subscriber_count() > 0;
        if !listened || (!asked && self.centers_of == Some(state)) {
            return;
        }
        match self.outputs.centers.publish(self.machine.centers()) {
            Ok(()) => self.centers_of = Some(state),
            Err(error) => log::debug!("centres not published: {error}"),
        }
    }

    /// Publishes all free cells; late joiners receive the next message.
    fn free(&mut self) {
        let Some(publisher) = &self.outputs.free else {
            return;
        };
        if publisher.subscriber_count() == 0 {
            return;
        }
        for chunk in self.machine.free().into_iter().flatten() {
            if let Err(error) = publisher.publish(Arc::new(chunk)) {
                log::debug!("free cells not published: {error}");
                return;
            }
        }
    }

    fn finish(&mut self) {
        if let Some(writing) = self.writing.take()
            && writing.join().is_err()
        {
            log::error!("a map file was not completed");
        }
        self.correct(true);
        self.autosave.finish(&self.machine);
        self.update();
        let mut left = usize::MAX;
        while self.output.pending() > 0 && self.output.pending() < left {
            left = self.output.pending();
            self.update();
        }
        self.centers(true);
        // Messages not sent by then count as lost.
        self.output.flush();
        self.octomaps.iter().for_each(Octomaps::flush);
        let (clouds, voxels) = (self.machine.counts().clouds_in, self.machine.cells().len());
        let points = self.machine.distortion().points;
        log::info!("{clouds} clouds, {points} points in {voxels} voxels");
        if self.report_file.is_empty() {
            return;
        }
        let report = self.report();
        if let Err(error) = report::write(&self.report_file, &report, &self.diagnostics) {
            log::error!("{error}");
        }
    }
}
