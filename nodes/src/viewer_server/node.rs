//! ROS node of the viewer: subscriptions, server thread and compute thread.

use std::io::{IsTerminal, Write, stderr};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};
use lattice_msgs::tf2_msgs::TFMessage;
use serde::Serialize;

use super::access::Access;
use super::bridge::{HandOver, HeadsetTopics, NodeBridge};
use super::broadcast::{Broadcaster, BroadcasterCounts, Class, MapStream};
use super::map_source::{MapChange, MapSource};
use super::options::ViewerOptions;
use super::parameters::Settings;
use super::server::Server;
use super::session::{Input, InputCounts, Inputs, Waiting};
use super::sources::{FixedTransforms, FromChannel, Sources, Unwritten};
use crate::compute::{Compute, Inbox};
use crate::hurry::Hurry;
use crate::map_input::{MapLosses, MapRequests};
use crate::report;
use crate::start::{Finish, LAST_EVENTS, NodeError, ONCE_A_SECOND, open_params};
use lattice_runtime::logging::Throttle;
use lattice_runtime::qos::Qos;
use lattice_runtime::{Diagnostics, Level, Node, Runtime, SubscriptionExecutor, Undecoded};

/// Event for the compute thread.
enum Event {
    Map(Undecoded<LatticeMap>),
    Update(Undecoded<LatticeMapUpdate>),
    FixedTransforms(Arc<TFMessage>),
    Message(u32, Unwritten),
    /// Client message for a headset topic.
    Input(u64, Input),
    Tick,
    Finish,
}

impl FromChannel for Event {
    fn message(channel: u32, message: Unwritten) -> Self {
        Event::Message(channel, message)
    }
}

/// Report of the viewer.
#[derive(Serialize)]
struct ViewerReport {
    counts: BroadcasterCounts,
    inputs: InputCounts,
    voxels: usize,
    messages_lost: u64,
}

/// Starts the node.
pub fn start(runtime: &Runtime, name: &str) -> Result<Finish, NodeError> {
    let node = runtime.node(name)?;
    let params = node.params();
    let Settings {
        viewer,
        limits,
        reach,
        report_file,
    } = Settings::from_params(params)?;
    let broadcaster = Arc::new(Broadcaster::new(viewer.max_clients, node.activity()));
    broadcaster.map_channels(
        &node.resolve("voxel_map")?,
        &node.resolve("voxel_map_updates")?,
    );
    let one = Class::Newest { depth: 1 };
    let fixed_channel = broadcaster.channel::<TFMessage>(&node.resolve("/tf_static")?, one, true);
    let inputs = Arc::new(Inputs::default());
    let waiting = Arc::new(Waiting::new(limits.events, limits.bytes));
    let auth = viewer.request_auth()?;
    let identity = viewer.identity()?;
    let (losses, hurry) = (MapLosses::default(), Hurry::default());
    let mut compute_state = ComputeState {
        node: node.clone(),
        broadcaster: Arc::clone(&broadcaster),
        source: MapSource::new(viewer.max_voxels).hurried_by(&hurry),
        parts: None,
        inputs: Arc::clone(&inputs),
        waiting: Arc::clone(&waiting),
        fixed: FixedTransforms::default(),
        fixed_channel,
        input: MapRequests::new(&node, &reach.mapper, &losses)?,
        diagnostics: node.diagnostics(),
        seconds: Throttle::new(ONCE_A_SECOND),
        report_file,
    };
    // Received by the compute thread's handler at its first event.
    let (give, take) = crossbeam_channel::bounded(1);
    let compute = Compute::spawn(name, limits, runtime.shutdown_handle(), move |event| {
        if compute_state.parts.is_none() {
            compute_state.parts = take.recv().ok();
        }
        compute_state.on(event)
    })?;
    let inbox = compute.inbox();
    let hand_over = hand_over(&inbox, waiting);
    let (bridge, headset) = NodeBridge::new(&node, &reach, &broadcaster, (inputs, hand_over))?;
    broadcaster.set_bridge(Box::new(bridge));
    let sources = Sources::new(&node, &broadcaster, &viewer, &inbox)?;
    let _ = give.send(Parts { sources, headset });
    // Started after the channels exist: clients receive the channel list once.
    let tls = identity.as_ref().map(|identity| identity.config.clone());
    let server = Server::start(viewer.address, auth.clone(), tls, Arc::clone(&broadcaster))?;
    tell_address(&Access::new(server.address(), &auth, identity.as_ref()));
    let maps = losses.subscribe(&node, &inbox, Event::Map, Event::Update)?;
    let on_fixed = inbox.counting(
        &losses.at_inbox,
        Event::FixedTransforms,
        |fixed: &Arc<TFMessage>| fixed.transforms.len() * 100,
    );
    let fixed = node.subscribe(
        "/tf_static",
        Qos::TF_STATIC_LISTENER,
        SubscriptionExecutor::Shared,
        on_fixed,
    )?;
    let period = |viewer: &ViewerOptions| Duration::from_secs_f64(viewer.update_period_s);
    let ticks = inbox.ticks((runtime, &node), period(&viewer), || Event::Tick);
    open_params(params, move |params| {
        let settings = Settings::from_params(params).map_err(|error| error.to_string())?;
        ticks.set(period(&settings.viewer));
        Ok(())
    });
    Ok(Box::new(move || {
        drop((maps, fixed));
        compute.finish_within(Event::Finish, LAST_EVENTS, || hurry.request());
        server.finish();
        Box::new(())
    }))
}

/// Sends client messages to the compute thread.
fn hand_over(inbox: &Inbox<Event>, waiting: Arc<Waiting>) -> HandOver {
    let inbox = inbox.clone();
    Box::new(move |client, input| {
        let bytes = input.bytes.len();
        if !waiting.enter(bytes) {
            return false;
        }
        let sent = inbox.send(Event::Input(client, input), bytes);
        if !sent {
            waiting.leave(bytes);
        }
        sent
    })
}

/// Parts created on the compute thread.
struct Parts {
    sources: Sources,
    headset: HeadsetTopics,
}

/// Logs the URL of the page. A URL with a token is printed to the terminal only: `/rosout` and log files are public.
fn tell_address(access: &Access) {
    let url = &access.url;
    match access.has_token {
        true => {
            log::info!(
                "the address of the map contains a token and is printed to the terminal only"
            );
            // A closed terminal is not an error.
            let _ = writeln!(stderr(), "the map is at {url}");
        }
        false => log::info!("the map is at {url}"),
    }
    if let Some(fingerprint) = &access.fingerprint {
        log::info!("SHA-256 fingerprint of the certificate: {fingerprint}");
    }
    if let Some(text) = access.for_headset(stderr().is_terminal()) {
        let _ = write!(stderr(), "{text}");
    }
}

/// State of the compute thread.
struct ComputeState {
    node: Node,
    broadcaster: Arc<Broadcaster>,
    source: MapSource,
    parts: Option<Parts>,
    inputs: Arc<Inputs>,
    waiting: Arc<Waiting>,
    fixed: FixedTransforms,
    fixed_channel: u32,
    input: MapRequests,
    diagnostics: Diagnostics,
    seconds: Throttle,
    report_file: String,
}

impl ComputeState {
    fn on(&mut self, event: Event) {
        match event {
            Event::Map(chunk) => {
                self.input.map(chunk, |chunk| self.source.on_map(chunk));
            }
            Event::Update(chunk) => {
                self.input
                    .update(chunk, |chunk| self.source.on_update(chunk));
            }
            Event::FixedTransforms(message) => {
                if let Ok(all) = self.fixed.add(&message) {
                    self.broadcaster.offer(self.fixed_channel, all);
                }
            }
            Event::Message(channel, message) => match message() {
                Ok(cdr) => self.broadcaster.offer(channel, cdr),
                Err(error) => log::debug!("not forwarded: {error}"),
            },
            Event::Input(client, input) => self.pass(client, &input),
            Event::Tick => self.tick(),
            Event::Finish => self.finish(),
        }
    }

    /// Publishes a client's message, or notifies the client of the reason for its rejection.
    fn pass(&mut self, client: u64, input: &Input) {
        self.waiting.leave(input.bytes.len());
        let Some(parts) = &self.parts else { return };
        match parts.headset.publish(input) {
            Ok(()) => self.inputs.taken(input.bytes.len()),
            Err(refusal) => {
                self.inputs.refused(refusal);
                self.broadcaster.refuse(client, refusal);
            }
        }
    }

    fn tick(&mut self) {
        self.input.make_good();
        if self.broadcaster.clients() > 0 {
            self.node.activity().note();
        }
        let second = self.seconds.check().is_some();
        if second && self.source.check_keyframe_timeout() {
            self.input.ask_for_keyframe();
        }
        if let Some(parts) = &mut self.parts {
            parts.sources.adapt(&self.broadcaster);
        }
        self.feed();
        if second {
            if self.broadcaster.graph_wanted() {
                self.broadcaster
                    .set_graph(self.node.graph().into_iter().collect());
            }
            self.diagnose();
        }
    }

    /// Sends map changes to clients, and a keyframe if needed.
    fn feed(&mut self) {
        match self.source.take_change() {
            Ok(MapChange::Unchanged) => {}
            Ok(MapChange::Replaced) => self.broadcaster.change_map(MapStream::reset),
            Ok(MapChange::Updates(updates)) => self
                .broadcaster
                .change_map(|stream| updates.into_iter().for_each(|update| stream.push(update))),
            Err(error) => log::warn!("the map was not sent to clients: {error}"),
        }
        if !self.broadcaster.keyframe_wanted() {
            return;
        }
        // Outside the lock: encoding takes time, and only this thread changes the map.
        match self.source.keyframe() {
            Ok(Some(chunks)) => self
                .broadcaster
                .change_map(|stream| stream.set_keyframe(chunks)),
            Ok(None) => {}
            Err(error) => log::warn!("the map was not sent to clients: {error}"),
        }
    }

    fn messages_lost(&self) -> u64 {
        let others = self.parts.as_ref();
        let others = others.map_or(0, |parts| parts.sources.lost.load(Ordering::Relaxed));
        self.input.losses().count() + others
    }

    fn voxels(&self) -> usize {
        self.source.map().map_or(0, |map| map.voxels().len())
    }

    fn diagnose(&self) {
        let clients = self.broadcaster.clients();
        let inputs = self.inputs.counts();
        let mut values = report::key_values(&self.broadcaster.counts());
        values.extend(report::key_values(&inputs));
        values.push(("clients".into(), clients.to_string()));
        values.push(("voxels".into(), self.voxels().to_string()));
        values.push(("messages_lost".into(), self.messages_lost().to_string()));
        let (level, message) = match self.source.map() {
            None => (Level::Warn, "no map yet".to_owned()),
            Some(_) if inputs.headset_refused.is_empty() => {
                (Level::Ok, format!("{clients} clients"))
            }
            Some(_) => {
                let refused = inputs.headset_refused.iter();
                let refused = refused.map(|(reason, n)| format!("{n} {reason}"));
                let refused: Vec<_> = refused.collect();
                let message = format!("{clients} clients; rejected: {}", refused.join(", "));
                (Level::Warn, message)
            }
        };
        self.diagnostics.set("viewer", level, message, values);
    }

    fn finish(&mut self) {
        self.feed();
        if let Some(parts) = &mut self.parts {
            parts.sources.end();
        }
        let report = ViewerReport {
            counts: self.broadcaster.counts(),
            inputs: self.inputs.counts(),
            voxels: self.voxels(),
            messages_lost: self.messages_lost(),
        };
        if let Err(error) = report::write(&self.report_file, &report, &self.diagnostics) {
            log::error!("{error}");
        }
    }
}
