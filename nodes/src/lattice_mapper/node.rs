//! The mapper as a ROS node: a thin shell around [`LatticeMapper`].

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use lattice_msgs::geographic_msgs::GeoPointStamped;
use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_msgs::std_msgs::Empty;

use super::{LatticeMapper, MapperOptions};
use crate::enu_transformer::node::SCANS;
use crate::node::{Finish, NodeError, warn_unused};
use crate::report::{self, MapperReport};
use crate::runtime::logging::Throttle;
use crate::runtime::qos::Qos;
use crate::runtime::{Diagnostics, Level, Load, Node, Publisher, Runtime};
use crate::worker::{Inbox, Worker, WorkerLimits};

/// What the compute thread is told.
enum Event {
    Cloud(Arc<PointCloud2>),
    Origin(Arc<GeoPointStamped>),
    Update,
    Centers,
    Keyframe,
    Reset,
    /// Ends, with the samples that did not decode and the clouds that were lost before the inbox.
    Finish {
        undecodable: u64,
        lost: u64,
    },
}

/// Starts the node.
pub fn start(runtime: &Runtime, name: &str) -> Result<Finish, NodeError> {
    let node = runtime.node(name)?;
    let params = node.params();
    let options = MapperOptions::from_params(params)?;
    let limits = WorkerLimits {
        events: params.usize("inbox_events", 4096)?,
        bytes: params.usize("inbox_bytes", 256 << 20)?,
        threads: params.usize("threads", 0)?,
    };
    let update_period = period(&node, "update_period_s", 0.2)?;
    let centers_period = period(&node, "centers_period_s", 1.0)?;
    let lost = Arc::new(AtomicU64::new(0));
    let mut shell = Shell {
        machine: LatticeMapper::new(options, epoch())?,
        outputs: Outputs::open(&node)?,
        diagnostics: node.diagnostics(),
        lost: Arc::clone(&lost),
        refusals: Throttle::new(Duration::from_secs(5)),
        keyframe_due: false,
        centers_of: 0,
        report_file: params.string("report_file", "")?,
    };
    let map = shell.outputs.map.clone();
    let worker = Worker::spawn(name, limits, move |event| shell.on(event))?;
    let inbox = worker.inbox();
    let clouds = inbox.clone();
    let hand_over = move |cloud: Arc<PointCloud2>| {
        let bytes = cloud.data.len();
        if !clouds.send(Event::Cloud(cloud), bytes) {
            lost.fetch_add(1, Ordering::Relaxed);
        }
    };
    let points = node.subscribe("points_enu", SCANS, Load::Large, hand_over)?;
    let origins = inbox.clone();
    let origins = node.subscribe("map_origin", Qos::LATCHED, Load::Small, move |origin| {
        tell(&origins, Event::Origin(origin));
    })?;
    let joined = inbox.clone();
    map.on_subscriber_joined(move || tell(&joined, Event::Keyframe));
    // By topic too: our own followers need no answer, and the topic passes inside a process.
    let requests = inbox.clone();
    let ask = move |_: Arc<Empty>| tell(&requests, Event::Keyframe);
    let asked = node.subscribe("~/request_keyframe", Qos::DEFAULT, Load::Small, ask)?;
    let services = inbox.clone();
    let request_keyframe = node.service_trigger("~/request_keyframe", move || {
        let sent = services.send(Event::Keyframe, 0);
        (
            sent,
            if sent {
                "keyframe follows"
            } else {
                "busy, ask again"
            }
            .into(),
        )
    })?;
    let services = inbox.clone();
    let reset = node.service_trigger("~/reset", move || {
        let sent = services.send(Event::Reset, 0);
        (
            sent,
            if sent {
                "map emptied"
            } else {
                "busy, ask again"
            }
            .into(),
        )
    })?;
    let updates = inbox.clone();
    runtime.timer(update_period, move || tell(&updates, Event::Update));
    runtime.timer(centers_period, move || tell(&inbox, Event::Centers));
    warn_unused(params);
    Ok(Box::new(move || {
        let undecodable = points.undecodable() + origins.undecodable();
        let lost = points.lost();
        drop((points, origins, asked, request_keyframe, reset));
        worker.finish_with(Event::Finish { undecodable, lost });
    }))
}

/// Hands over a small event; one that finds no room comes again with the next timer.
fn tell(inbox: &Inbox<Event>, event: Event) {
    if !inbox.send(event, 0) {
        log::debug!("the inbox is full");
    }
}

/// Epochs of one map after another differ, those of restarted nodes too.
fn epoch() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(1, |since| since.as_nanos() as u64)
}

fn period(node: &Node, name: &str, default_s: f64) -> Result<Duration, NodeError> {
    let params = node.params();
    let seconds = params.f64(name, default_s)?;
    Duration::try_from_secs_f64(seconds)
        .ok()
        .filter(|period| *period >= Duration::from_millis(10))
        .ok_or_else(|| {
            params
                .invalid(name, format!("{seconds}, expected 0.01 or more"))
                .into()
        })
}

/// The topics that the node speaks on.
struct Outputs {
    map: Publisher<LatticeMap>,
    updates: Publisher<LatticeMapUpdate>,
    centers: Publisher<PointCloud2>,
}

impl Outputs {
    fn open(node: &Node) -> Result<Self, NodeError> {
        Ok(Self {
            map: node.publisher("map", Qos::MAP)?,
            updates: node.publisher("map_updates", Qos::DELTAS)?,
            centers: node.publisher("map_centers", Qos::LATCHED)?,
        })
    }
}

/// State of the compute thread.
struct Shell {
    machine: LatticeMapper,
    outputs: Outputs,
    diagnostics: Diagnostics,
    lost: Arc<AtomicU64>,
    refusals: Throttle,
    keyframe_due: bool,
    /// Clouds that the last centres were made of.
    centers_of: u64,
    report_file: String,
}

impl Shell {
    fn on(&mut self, event: Event) {
        match event {
            Event::Cloud(cloud) => {
                if let Err(refusal) = self.machine.on_cloud(&cloud)
                    && let Some(more) = self.refusals.check()
                {
                    log::warn!("{refusal} ({more} more like it)");
                }
            }
            Event::Origin(origin) => self.machine.on_origin(&origin),
            Event::Update => self.update(),
            Event::Centers => self.centers(),
            Event::Keyframe => self.keyframe_due = true,
            Event::Reset => {
                self.machine.reset(epoch());
                self.keyframe_due = true;
            }
            Event::Finish { undecodable, lost } => self.finish(undecodable, lost),
        }
    }

    /// Publishes what changed, and a keyframe where one was asked for or an update was lost.
    fn update(&mut self) {
        for chunk in self.machine.take_update() {
            if self.outputs.updates.publish(Arc::new(chunk)).is_err() {
                self.keyframe_due = true;
            }
        }
        if std::mem::take(&mut self.keyframe_due) {
            for chunk in self.machine.keyframe() {
                if let Err(error) = self.outputs.map.publish(Arc::new(chunk)) {
                    log::debug!("keyframe cut short: {error}");
                    self.keyframe_due = true;
                    break;
                }
            }
        }
        self.diagnose();
    }

    fn centers(&mut self) {
        let clouds = self.machine.counts().clouds_in;
        if clouds == self.centers_of || self.outputs.centers.subscriber_count() == 0 {
            return;
        }
        self.centers_of = clouds;
        if let Err(error) = self
            .outputs
            .centers
            .publish(Arc::new(self.machine.centers()))
        {
            log::debug!("centres not published: {error}");
        }
    }

    fn report(&mut self) -> MapperReport {
        MapperReport {
            clouds_inbox_full: self.lost.load(Ordering::Relaxed),
            ..MapperReport::of(&mut self.machine)
        }
    }

    fn diagnose(&self) {
        let counts = self.machine.counts();
        let lost = self.lost.load(Ordering::Relaxed);
        let refused = counts.clouds_malformed + counts.clouds_wrong_frame;
        let (level, message) = if counts.clouds_in == 0 {
            (Level::Warn, "no cloud yet".to_owned())
        } else if counts.points_list_full > 0 {
            (Level::Warn, "the list is full (`max_voxels`)".to_owned())
        } else if refused + lost > 0 {
            (
                Level::Warn,
                format!("{refused} clouds refused, {lost} lost"),
            )
        } else {
            (Level::Ok, "mapping".to_owned())
        };
        let mut values = report::key_values(counts);
        let distortion = self.machine.distortion();
        values.extend([
            ("clouds_inbox_full".into(), lost.to_string()),
            ("voxels".into(), self.machine.list().len().to_string()),
            ("rms_m".into(), format!("{:.5}", distortion.rms_m)),
        ]);
        self.diagnostics.set("map", level, message, values);
    }

    fn finish(&mut self, undecodable: u64, lost: u64) {
        self.lost.fetch_add(lost, Ordering::Relaxed);
        self.update();
        self.centers();
        let report = MapperReport {
            undecodable,
            ..self.report()
        };
        log::info!(
            "{} clouds, {} points in {} voxels",
            report.counts.clouds_in,
            report.points,
            report.voxels
        );
        self.outputs.map.flush(Duration::from_secs(2));
        self.outputs.updates.flush(Duration::from_secs(2));
        if let Err(error) = report::write(&self.report_file, &report) {
            log::error!("{}: {error}", self.report_file);
        }
    }
}
