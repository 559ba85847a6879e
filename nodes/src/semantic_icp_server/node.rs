//! ROS node around [`SemanticIcpServer`].

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use lattice_msgs::lattice::{
    Calibrate, CalibrateAction, CalibrateGoal, CalibrateRequest, CalibrateResponse,
    CalibrateResult, CalibrationResult, LatticeMap, LatticeMapUpdate,
};
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_msgs::std_msgs::{Empty, String as StringMessage};
use lattice_msgs::vision_msgs::LabelInfo;

use super::diagnosis::diagnosis;
use super::outputs::Outputs;
use super::parameters::Settings;
use super::search_thread::{SearchPort, SearchThread};
use super::{CallId, End, LatticeSearch, Output, SemanticIcpServer, ServerOptions, ServerReport};
use crate::compute::{Compute, Inbox};
use crate::convert::cloud;
use crate::hurry::Hurry;
use crate::report;
use crate::start::{Finish, LAST_EVENTS, NodeError, handed_over, open_params};
use lattice_runtime::SubscriptionExecutor::{Dedicated, Shared};
use lattice_runtime::logging::Throttle;
use lattice_runtime::qos::Qos;
use lattice_runtime::{
    ActionLimits, Activity, Clock, Diagnostics, Feedback, GoalHandle, Losses, Reply, Runtime,
    TfGuard, Undecoded, lock,
};

/// Period of the diagnostic status.
const DIAGNOSE: Duration = Duration::from_secs(1);

/// Event for the thread of the machine.
enum Event {
    SearchPort(SearchPort),
    Map(Undecoded<LatticeMap>),
    Update(Undecoded<LatticeMapUpdate>),
    Cloud(Arc<PointCloud2>),
    Session(Arc<StringMessage>),
    LabelInfo(Arc<LabelInfo>),
    Request(Box<CalibrateRequest>, Reply<CalibrateResponse>),
    Goal(Box<CalibrateGoal>, GoalHandle<CalibrateAction>),
    /// A client has canceled, or the search thread has events.
    Look,
    Tick,
    Diagnose,
    Settings(Box<ServerOptions>),
    Finish,
}

/// Starts the node.
pub fn start(runtime: &Runtime, name: &str) -> Result<Finish, NodeError> {
    let node = runtime.node(name)?;
    let params = node.params();
    let Settings {
        server,
        limits,
        search_threads,
        tf_period,
        mapper,
        report_file,
    } = Settings::from_params(params)?;
    let search = LatticeSearch::new(server.calibration);
    let calibration = search.options();
    let lost = Arc::new(AtomicU64::new(0));
    let map_lost = Arc::new(AtomicBool::new(false));
    let losses = Losses::default();
    let hurry = Hurry::default();
    let guard = TfGuard::new(|_, _| "another headset_frame".to_owned());
    let mut compute_state = ComputeState {
        activity: node.activity(),
        losses: losses.clone(),
        machine: SemanticIcpServer::new(server).hurried_by(&hurry),
        search: None,
        outputs: Outputs::open(&node, &mapper, &guard)?,
        diagnostics: node.diagnostics(),
        clock: node.clock(),
        lost: Arc::clone(&lost),
        map_lost: Arc::clone(&map_lost),
        calls: BTreeMap::new(),
        next_call: 0,
        requests: Throttle::new(Duration::from_secs(1)),
        refusals: Throttle::new(Duration::from_secs(5)),
        report_file,
    };
    let compute = Compute::spawn(name, limits, runtime.shutdown_handle(), move |event| {
        compute_state.on(event)
    })?;
    let inbox = compute.inbox();
    let wake = inbox.clone();
    let thread = SearchThread::spawn(
        &format!("{name} search"),
        search_threads,
        runtime.shutdown_handle(),
        search,
        move || notify(&wake, Event::Look),
    )?;
    // First event of the inbox.
    notify(&inbox, Event::SearchPort(thread.port()));

    let (to, missed, part) = (inbox.clone(), Arc::clone(&lost), Arc::clone(&map_lost));
    let on_map = move |map: Undecoded<LatticeMap>| {
        let bytes = map.bytes(|map| map.keys.len() + map.counts.len() * 16);
        if !hand_over(&to, Event::Map(map), bytes, &missed) {
            part.store(true, Ordering::Relaxed);
        }
    };
    let maps = node.subscribe_undecoded("voxel_map", Qos::MAP, Shared, on_map)?;
    let (to, missed, part) = (inbox.clone(), Arc::clone(&lost), map_lost);
    let on_update = move |update: Undecoded<LatticeMapUpdate>| {
        let bytes = update.bytes(|update| {
            update.keys.len() + update.counts.len() * 16 + update.removed_keys.len()
        });
        if !hand_over(&to, Event::Update(update), bytes, &missed) {
            part.store(true, Ordering::Relaxed);
        }
    };
    let updates = node.subscribe_undecoded("voxel_map_updates", Qos::DELTAS, Shared, on_update)?;
    let transforms = guard.subscribe(&node)?;
    let on_cloud = inbox.counting(&lost, Event::Cloud, |cloud| cloud::bytes_of(cloud));
    let clouds = node.subscribe("headset/points", Qos::SENSOR, Dedicated, on_cloud)?;
    let on_session = inbox.counting(&lost, Event::Session, |_| 0);
    let sessions = node.subscribe("headset/session", Qos::LATCHED, Shared, on_session)?;
    let on_info = inbox.counting(&lost, Event::LabelInfo, |_| 0);
    let infos = node.subscribe("headset/label_info", Qos::LATCHED, Shared, on_info)?;

    losses.watch([&maps, &updates, &clouds, &sessions, &infos]);
    // A headset may join at any time.
    node.expect_publishers([&maps], "lattice_mapper", None, |_| true);
    let to = inbox.clone();
    // Replies are concurrent, so that a busy server can reject at once.
    let service =
        node.service_concurrent::<Calibrate>("~/calibrate", 16, move |request, reply| {
            let busy = reply.clone();
            if !to.send(Event::Request(Box::new(request), reply), 0) {
                busy.send(CalibrateResponse {
                    message: "the inbox of the node is full: call again".into(),
                    ..CalibrateResponse::default()
                });
            }
        })?;
    let (to, look) = (inbox.clone(), inbox.clone());
    let action = Arc::new(node.action_server::<CalibrateAction>(
        "~/calibrate",
        ActionLimits::default(),
        move |goal, handle| to.send(Event::Goal(Box::new(goal), handle), 0),
        move |_| notify(&look, Event::Look),
    )?);
    let goals = Arc::clone(&action);
    let tf_period = inbox.ticks((runtime, &node), tf_period, || Event::Tick);
    let diagnoses = inbox.clone();
    let seconds = runtime.timer(DIAGNOSE, move || {
        goals.expire();
        notify(&diagnoses, Event::Diagnose);
    });
    open_params(params, move |params| {
        let settings = Settings::from_params(params).map_err(|error| error.to_string())?;
        let options = settings.server.calibration;
        handed_over(inbox.send(Event::Settings(Box::new(settings.server)), 0))?;
        *lock(&calibration) = options;
        tf_period.set(settings.tf_period);
        Ok(())
    });
    Ok(Box::new(move || {
        drop((maps, updates, transforms, clouds, sessions, infos));
        compute.finish_within(Event::Finish, LAST_EVENTS, || hurry.request());
        thread.finish();
        drop(seconds);
        Box::new((service, action))
    }))
}

/// Sends a message event; a rejected one is counted as lost and returns false.
fn hand_over(inbox: &Inbox<Event>, event: Event, bytes: usize, lost: &AtomicU64) -> bool {
    let sent = inbox.send(event, bytes);
    lost.fetch_add(u64::from(!sent), Ordering::Relaxed);
    sent
}

/// Sends an event whose work is also done with the next one, within a second.
fn notify(inbox: &Inbox<Event>, event: Event) {
    if !inbox.send(event, 0) {
        log::debug!("the inbox is full");
    }
}

/// A waiting client.
enum Client {
    Service(Reply<CalibrateResponse>),
    Action(GoalHandle<CalibrateAction>, Feedback<CalibrateAction>),
}

/// State of the compute thread.
struct ComputeState {
    activity: Activity,
    machine: SemanticIcpServer,
    search: Option<SearchPort>,
    outputs: Outputs,
    diagnostics: Diagnostics,
    clock: Clock,
    /// Messages rejected by a full inbox.
    lost: Arc<AtomicU64>,
    /// Losses before the inbox.
    losses: Losses,
    /// True if map messages are among them.
    map_lost: Arc<AtomicBool>,
    calls: BTreeMap<CallId, Client>,
    next_call: CallId,
    requests: Throttle,
    refusals: Throttle,
    report_file: String,
}

impl ComputeState {
    fn on(&mut self, event: Event) {
        let now_ns = self.clock.now_ns();
        let outputs = match event {
            Event::SearchPort(port) => {
                self.search = Some(port);
                Vec::new()
            }
            Event::Map(chunk) => match chunk.decode() {
                Some(chunk) => self.machine.on_map(&chunk, now_ns),
                None => Vec::new(),
            },
            Event::Update(chunk) => match chunk.decode() {
                Some(chunk) => self.machine.on_map_update(&chunk, now_ns),
                None => Vec::new(),
            },
            Event::Cloud(cloud) => self.machine.on_headset_cloud(&cloud, now_ns),
            Event::Session(session) => self.machine.on_session(&session, now_ns),
            Event::LabelInfo(info) => {
                self.machine.on_label_info(&info);
                Vec::new()
            }
            Event::Request(request, reply) => {
                let CalibrateRequest {
                    has_guess,
                    guess,
                    session,
                } = *request;
                let goal = CalibrateGoal {
                    has_guess,
                    guess,
                    session,
                };
                let call = self.remember(Client::Service(reply));
                self.machine.calibrate(call, &goal, now_ns)
            }
            Event::Goal(goal, handle) => {
                handle.execute();
                let feedback = handle.feedback();
                let call = self.remember(Client::Action(handle, feedback));
                self.machine.calibrate(call, &goal, now_ns)
            }
            Event::Look => Vec::new(),
            Event::Tick => self.machine.tick(now_ns).into_iter().collect(),
            Event::Diagnose => {
                self.diagnose();
                let overdue = self.machine.check_keyframe_timeout();
                let lost = self.map_lost.swap(false, Ordering::Relaxed);
                overdue
                    .or(lost.then_some(Output::NeedKeyframe))
                    .into_iter()
                    .collect()
            }
            Event::Settings(options) => {
                self.machine.set_options(*options);
                Vec::new()
            }
            Event::Finish => {
                let outputs = self.machine.finish();
                self.write_report();
                outputs
            }
        };
        self.put(outputs);
        self.look(now_ns);
    }

    fn remember(&mut self, client: Client) -> CallId {
        self.next_call += 1;
        self.calls.insert(self.next_call, client);
        self.next_call
    }

    /// Handles search events and canceled requests.
    fn look(&mut self, now_ns: i64) {
        let search = self.search.as_ref();
        let progress = search.and_then(SearchPort::take_progress);
        let done = search.map_or_else(Vec::new, SearchPort::take_done);
        if let Some((job, stage, fraction)) = progress {
            let feedback = self.machine.on_progress(job, stage, fraction);
            self.put(feedback.into_iter().collect());
        }
        for (job, done) in done {
            let outputs = self.machine.on_done(job, done, now_ns);
            self.put(outputs);
        }
        let canceled = |(call, client): (&CallId, &Client)| match client {
            Client::Action(handle, _) => handle.is_canceled().then_some(*call),
            Client::Service(_) => None,
        };
        let canceled: Vec<CallId> = self.calls.iter().filter_map(canceled).collect();
        for call in canceled {
            let outputs = self.machine.cancel(call);
            self.put(outputs);
        }
    }

    fn put(&mut self, outputs: Vec<Output>) {
        for output in outputs {
            match output {
                Output::Result(result) => {
                    if result.verdict != CalibrationResult::OK
                        && let Some(more) = self.refusals.check()
                    {
                        log::info!("not calibrated: {} ({more} more like it)", result.reason);
                    }
                    if let Err(error) = self.outputs.calibration.publish(*result) {
                        log::warn!("calibration not published: {error}");
                    }
                }
                Output::Transform(transform) => {
                    // It is repeated in the next period.
                    self.activity.note();
                    if let Err(error) = self.outputs.tf.send(vec![transform]) {
                        log::debug!("transform not published: {error}");
                    }
                }
                Output::Job(job) => {
                    if !self.search.as_ref().is_some_and(|search| search.begin(job)) {
                        log::error!("the search thread accepts no job");
                    }
                }
                Output::Answer(call, end, result) => self.answer(call, end, *result),
                Output::Feedback(call, feedback) => {
                    if let Some(Client::Action(_, to)) = self.calls.get(&call) {
                        to.send(feedback);
                    }
                }
                Output::NeedKeyframe => {
                    if self.requests.check().is_some()
                        && let Err(error) = self.outputs.request.publish(Empty::default())
                    {
                        log::debug!("keyframe not requested: {error}");
                    }
                }
            }
        }
    }

    fn answer(&mut self, call: CallId, end: End, result: CalibrateResult) {
        match self.calls.remove(&call) {
            Some(Client::Service(reply)) => reply.send(CalibrateResponse {
                success: result.success,
                message: result.message,
                result: result.result,
            }),
            Some(Client::Action(handle, _)) => match end {
                End::Found => handle.succeed(result),
                End::Failed => handle.abort(result),
                End::Canceled => handle.cancel(result),
            },
            None => {}
        }
    }

    fn report(&self) -> ServerReport<'_> {
        ServerReport {
            counts: self.machine.counts(),
            inbox_full: self.lost.load(Ordering::Relaxed) + self.losses.overrun(),
            lost_on_network: self.losses.on_network(),
            undecodable: self.losses.undecodable(),
            map_voxels: self.machine.map_voxels(),
            map_differences: self.machine.map_differences(),
        }
    }

    fn write_report(&self) {
        let written = report::write(&self.report_file, &self.report(), &self.diagnostics);
        if let Err(error) = written {
            log::error!("{error}");
        }
    }

    fn diagnose(&self) {
        let (level, message, values) = diagnosis(&self.machine, &self.report());
        self.diagnostics.set("calibration", level, message, values);
    }
}
