//! ROS node around [`VoxelMarkers`].

use std::sync::Arc;
use std::time::{Duration, Instant};

use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};
use lattice_msgs::visualization_msgs::MarkerArray;

use super::parameters::Settings;
use super::{MarkerOptions, MarkerReport, VoxelMarkers};
use crate::compute::Compute;
use crate::hurry::Hurry;
use crate::map_input::{MapLosses, MapRequests};
use crate::report;
use crate::start::{
    Finish, LAST_EVENTS, LAST_FLUSH, NodeError, ONCE_A_SECOND, handed_over, open_params,
};
use lattice_runtime::logging::Throttle;
use lattice_runtime::qos::Qos;
use lattice_runtime::{Activity, Diagnostics, Level, Publisher, Runtime, Undecoded};

/// Acknowledgement delay that triggers a warning: two heartbeats of Fast DDS, the
/// slowest to repair.
const LATE: Duration = Duration::from_secs(6);

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
    let publisher = node.lossless_publisher("voxel_markers", Qos::MARKERS)?;
    let (losses, hurry) = (MapLosses::default(), Hurry::default());
    let mut compute_state = ComputeState {
        activity: node.activity(),
        input: MapRequests::new(&node, &settings.mapper, &losses)?,
        machine: VoxelMarkers::new(settings.markers).hurried_by(&hurry),
        markers: publisher.clone(),
        diagnostics: node.diagnostics(),
        seconds: Throttle::new(ONCE_A_SECOND),
        budget_bytes: settings.budget_bytes,
        waits_since: None,
        report_file: settings.report_file,
    };
    let compute = Compute::spawn(
        name,
        settings.limits,
        runtime.shutdown_handle(),
        move |event| compute_state.on(event),
    )?;
    let inbox = compute.inbox();
    let subscriptions = losses.subscribe(&node, &inbox, Event::Map, Event::Update)?;
    let joined = inbox.clone();
    publisher.on_subscriber_joined(move || {
        let _ = joined.send(Event::Redraw, 0);
    });
    let period = inbox.ticks((runtime, &node), settings.period, || Event::Draw);
    open_params(params, move |params| {
        let settings = Settings::from_params(params).map_err(|error| error.to_string())?;
        let event = Event::Settings(settings.markers, settings.budget_bytes);
        handed_over(inbox.send(event, 0))?;
        period.set(settings.period);
        Ok(())
    });
    Ok(Box::new(move || {
        drop(subscriptions);
        compute.finish_within(Event::Finish, LAST_EVENTS, || hurry.request());
        Box::new(())
    }))
}

/// State of the compute thread.
struct ComputeState {
    activity: Activity,
    input: MapRequests,
    machine: VoxelMarkers,
    markers: Publisher<MarkerArray>,
    diagnostics: Diagnostics,
    seconds: Throttle,
    budget_bytes: usize,
    /// Start of the wait for acknowledgements.
    waits_since: Option<Instant>,
    report_file: String,
}

impl ComputeState {
    fn on(&mut self, event: Event) {
        match event {
            Event::Map(chunk) => {
                self.input.map(chunk, |chunk| self.machine.on_map(chunk));
            }
            Event::Update(chunk) => {
                self.input
                    .update(chunk, |chunk| self.machine.on_update(chunk));
            }
            Event::Redraw => self.machine.redraw(),
            Event::Draw => {
                self.input.make_good();
                if self.seconds.check().is_some() && self.machine.check_keyframe_timeout() {
                    self.input.ask_for_keyframe();
                }
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

    /// Publishes changed blocks once the previous markers are acknowledged. Until then changes accumulate, and a
    /// block with many changes is sent once. Nothing is drawn without a subscriber.
    fn draw(&mut self) {
        if self.markers.subscriber_count() == 0 {
            self.waits_since = None;
            self.machine.rest();
            return;
        }
        self.machine.wake();
        if !self.markers.is_acknowledged() {
            self.waits_since.get_or_insert_with(Instant::now);
            self.activity.note();
            return;
        }
        self.waits_since = None;
        if !self.machine.is_dirty() {
            return;
        }
        for array in self.machine.take_arrays(self.budget_bytes) {
            if let Err(error) = self.markers.publish(Arc::new(array)) {
                log::debug!("markers not published: {error}");
            }
        }
        if self.machine.is_dirty() {
            self.activity.note();
        }
    }

    fn diagnose(&self) {
        let counts = self.machine.counts();
        let waits = self.waits_since.map(|since| since.elapsed());
        let late = waits.filter(|waits| *waits > LATE);
        let lost = self.markers.dropped();
        let (level, message) = match (counts.messages_in, counts.messages_refused, late) {
            (_, _, Some(waits)) => {
                let seconds = waits.as_secs();
                let text = format!(
                    "a subscriber has not acknowledged for {seconds} s: publication waits until it does or leaves"
                );
                (Level::Warn, text)
            }
            (0, ..) => (Level::Warn, "no map yet".to_owned()),
            (_, 0, None) if self.machine.is_resting() => {
                (Level::Ok, "nobody subscribes to voxel_markers".to_owned())
            }
            (_, 0, None) if lost > 0 => {
                let text =
                    format!("{lost} arrays not published: the queue is full; lower block_bits");
                (Level::Warn, text)
            }
            (_, 0, None) => (Level::Ok, format!("{:?}", self.machine.style())),
            (_, refused, None) => (Level::Warn, format!("{refused} messages rejected")),
        };
        let mut values = report::key_values(counts);
        let losses = self.input.losses();
        let undecodable = losses.undecodable();
        values.push(("inbox_full".into(), losses.inbox_full().to_string()));
        let on_network = losses.on_network();
        values.push(("lost_on_network".into(), on_network.to_string()));
        values.push(("undecodable".into(), undecodable.to_string()));
        values.push(("arrays_not_published".into(), lost.to_string()));
        let differences = self.machine.map_differences();
        values.push(("map_differences".into(), differences.to_string()));
        values.push(("voxels".into(), self.machine.voxels().to_string()));
        self.diagnostics.set("markers", level, message, values);
    }

    fn finish(&mut self) {
        // Several budgets in sequence, as fast as viewers acknowledge, for a limited time.
        let begin = Instant::now();
        self.draw();
        while self
            .markers
            .flush(LAST_FLUSH.saturating_sub(begin.elapsed()))
            && begin.elapsed() < LAST_FLUSH
            && self.markers.subscriber_count() > 0
            && self.machine.is_dirty()
        {
            self.draw();
        }
        let blocks_not_drawn = self.machine.blocks_due();
        if blocks_not_drawn > 0 && self.markers.subscriber_count() > 0 {
            log::warn!(
                "{}: {blocks_not_drawn} changed blocks are not sent: subscribers have not acknowledged the others within \
                 {LAST_FLUSH:?}",
                self.markers.topic()
            );
        }
        let voxels_not_drawn = self.machine.unplaced();
        if voxels_not_drawn > 0 {
            log::warn!("the node ends before it has drawn {voxels_not_drawn} changed voxels");
        }
        let counts = self.machine.counts().clone();
        let report = MarkerReport {
            counts,
            voxels: self.machine.voxels(),
            marker_bytes: self.machine.drawn_bytes(),
            published_bytes: self.markers.sent_bytes(),
            arrays_not_published: self.markers.dropped(),
            blocks_not_drawn,
            voxels_not_drawn,
            inbox_full: self.input.losses().inbox_full(),
            lost_on_network: self.input.losses().on_network(),
            undecodable: self.input.losses().undecodable(),
        };
        if let Err(error) = report::write(&self.report_file, &report, &self.diagnostics) {
            log::error!("{error}");
        }
    }
}
