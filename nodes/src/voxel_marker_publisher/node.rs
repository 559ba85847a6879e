//! The marker publisher as a ROS node: a thin shell around [`VoxelMarkers`].

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};
use lattice_msgs::std_msgs::Empty;
use lattice_msgs::visualization_msgs::MarkerArray;

use super::parameters::Settings;
use super::{MarkerOptions, MarkerReport, VoxelMarkers};
use crate::compute::Compute;
use crate::map_follower::{FollowError, Followed};
use crate::report;
use crate::start::{Finish, NodeError, handed_over, open_params};
use lattice_runtime::logging::Throttle;
use lattice_runtime::qos::Qos;
use lattice_runtime::{Diagnostics, Level, Load, Losses, Publisher, Runtime, Undecoded};

/// Longest wait for readers at the end, between two budgets of markers.
const FLUSH: Duration = Duration::from_secs(2);

/// Event for the compute thread.
enum Event {
    Map(Undecoded<LatticeMap>),
    Update(Undecoded<LatticeMapUpdate>),
    Redraw,
    Draw,
    Settings(MarkerOptions, usize),
    Finish,
}

/// Starts the node.
pub fn start(runtime: &Runtime, name: &str) -> Result<Finish, NodeError> {
    let node = runtime.node(name)?;
    let params = node.params();
    let settings = Settings::from_params(params)?;
    let publisher = node.publisher("voxel_markers", Qos::MARKERS)?;
    let lost = Arc::new(AtomicU64::new(0));
    let losses = Losses::default();
    let mut shell = Shell {
        losses: losses.clone(),
        lost: Arc::clone(&lost),
        lost_seen: 0,
        machine: VoxelMarkers::new(settings.markers),
        markers: publisher.clone(),
        request: node.publisher(
            &format!("{}/request_keyframe", settings.mapper),
            Qos::DEFAULT,
        )?,
        diagnostics: node.diagnostics(),
        refusals: Throttle::new(Duration::from_secs(5)),
        requests: Throttle::new(Duration::from_secs(1)),
        seconds: Throttle::new(Duration::from_secs(1)),
        budget_bytes: settings.budget_bytes,
        arrays_lost: 0,
        incomplete: false,
        repairs: Throttle::new(Duration::from_secs(5)),
        report_file: settings.report_file,
    };
    let compute = Compute::spawn(
        name,
        settings.limits,
        runtime.shutdown_handle(),
        move |event| shell.on(event),
    )?;
    let inbox = compute.inbox();
    let lost_map = Arc::clone(&lost);
    let lost_update = Arc::clone(&lost);
    let maps = inbox.clone();
    let on_map = move |map: Undecoded<LatticeMap>| {
        let bytes = map.bytes(|map| map.keys.len() + map.counts.len() * 10);
        if !maps.send(Event::Map(map), bytes) {
            lost_map.fetch_add(1, Ordering::Relaxed);
        }
    };
    let maps = node.subscribe_undecoded("map", Qos::MAP, Load::Small, on_map)?;
    let updates = inbox.clone();
    let on_update = move |update: Undecoded<LatticeMapUpdate>| {
        let bytes = update.bytes(|update| update.keys.len() + update.counts.len() * 10);
        if !updates.send(Event::Update(update), bytes) {
            lost_update.fetch_add(1, Ordering::Relaxed);
        }
    };
    let updates = node.subscribe_undecoded("map_updates", Qos::DELTAS, Load::Small, on_update)?;
    losses.watch([&maps, &updates]);
    let joined = inbox.clone();
    publisher.on_subscriber_joined(move || {
        let _ = joined.send(Event::Redraw, 0);
    });
    let draws = inbox.clone();
    let period = runtime.timer(settings.period, move || {
        let _ = draws.send(Event::Draw, 0);
    });
    open_params(params, move |params| {
        let settings = Settings::from_params(params).map_err(|error| error.to_string())?;
        let event = Event::Settings(settings.markers, settings.budget_bytes);
        handed_over(inbox.send(event, 0))?;
        period.set(settings.period);
        Ok(())
    });
    Ok(Box::new(move || {
        drop((maps, updates));
        compute.finish_with(Event::Finish);
        Box::new(())
    }))
}

/// State of the compute thread.
struct Shell {
    /// Chunks of the map that found the inbox full.
    lost: Arc<AtomicU64>,
    /// Chunks lost before it.
    losses: Losses,
    /// Those that a keyframe was asked for.
    lost_seen: u64,
    machine: VoxelMarkers,
    markers: Publisher<MarkerArray>,
    request: Publisher<Empty>,
    diagnostics: Diagnostics,
    refusals: Throttle,
    requests: Throttle,
    seconds: Throttle,
    budget_bytes: usize,
    /// Arrays lost by the publisher after which all is drawn again.
    arrays_lost: u64,
    incomplete: bool,
    repairs: Throttle,
    report_file: String,
}

impl Shell {
    fn on(&mut self, event: Event) {
        match event {
            Event::Map(chunk) => {
                let chunk = chunk.decode();
                if let Some(result) = chunk.map(|chunk| self.machine.on_map(&chunk)) {
                    self.followed(result);
                }
            }
            Event::Update(chunk) => {
                let chunk = chunk.decode();
                if let Some(result) = chunk.map(|chunk| self.machine.on_update(&chunk)) {
                    self.followed(result);
                }
            }
            Event::Redraw => self.machine.redraw(),
            Event::Draw => {
                let lost = self.chunks_lost();
                if lost != self.lost_seen {
                    self.lost_seen = lost;
                    self.ask_for_keyframe();
                }
                if self.seconds.check().is_some() && self.machine.wait_a_second() {
                    self.ask_for_keyframe();
                }
                self.repair();
                self.draw();
                self.diagnose();
            }
            Event::Settings(markers, budget_bytes) => {
                self.machine.set_options(markers);
                self.budget_bytes = budget_bytes;
            }
            Event::Finish => self.finish(),
        }
    }

    fn followed(&mut self, result: Result<Followed, FollowError>) {
        match result {
            Ok(Followed::NeedKeyframe) => self.ask_for_keyframe(),
            Ok(Followed::Applied | Followed::Old) => {}
            Err(error) => {
                if let Some(more) = self.refusals.check() {
                    log::warn!("{error} ({more} more like it)");
                }
            }
        }
    }

    fn ask_for_keyframe(&mut self) {
        if self.requests.check().is_some()
            && let Err(error) = self.request.publish(Empty::default())
        {
            log::debug!("keyframe not requested: {error}");
        }
    }

    /// Chunks lost on the way or at the inbox.
    fn chunks_lost(&self) -> u64 {
        self.lost.load(Ordering::Relaxed) + self.losses.lost()
    }

    fn draw(&mut self) {
        if !self.machine.is_dirty() {
            return;
        }
        for array in self.machine.take_arrays(self.budget_bytes) {
            if let Err(error) = self.markers.publish(Arc::new(array)) {
                log::debug!("markers not published: {error}");
            }
        }
    }

    /// Draws again after a loss, but not as fast as arrays are lost.
    fn repair(&mut self) {
        let lost = self.markers.dropped();
        self.incomplete |= lost != self.arrays_lost;
        self.arrays_lost = lost;
        if self.incomplete && self.repairs.check().is_some() {
            self.incomplete = false;
            self.machine.wipe();
        }
    }

    fn diagnose(&self) {
        let counts = self.machine.counts();
        let (level, message) = match (counts.messages_in, counts.messages_refused) {
            (0, _) => (Level::Warn, "no map yet".to_owned()),
            (_, 0) => (Level::Ok, format!("{:?}", self.machine.style())),
            (_, refused) => (Level::Warn, format!("{refused} messages refused")),
        };
        let mut values = report::key_values(counts);
        let (undecodable, arrays) = (self.losses.undecodable(), self.markers.dropped());
        values.push(("inbox_full".into(), self.chunks_lost().to_string()));
        values.push(("undecodable".into(), undecodable.to_string()));
        values.push(("arrays_not_published".into(), arrays.to_string()));
        let differences = self.machine.map_differences();
        values.push(("map_differences".into(), differences.to_string()));
        values.push(("voxels".into(), self.machine.voxels().to_string()));
        self.diagnostics.set("markers", level, message, values);
    }

    fn finish(&mut self) {
        // One budget after another, as fast as viewers take them.
        self.draw();
        while self.markers.flush(FLUSH)
            && self.markers.subscriber_count() > 0
            && self.machine.is_dirty()
        {
            self.draw();
        }
        let counts = self.machine.counts().clone();
        self.machine.wipe();
        let report = MarkerReport {
            counts,
            voxels: self.machine.voxels(),
            marker_bytes: self.machine.take_bytes(),
            published_bytes: self.markers.sent_bytes(),
            arrays_not_published: self.markers.dropped(),
            inbox_full: self.chunks_lost(),
            undecodable: self.losses.undecodable(),
        };
        if let Err(error) = report::write(&self.report_file, &report) {
            log::error!("{error}");
        }
    }
}
