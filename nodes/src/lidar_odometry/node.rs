//! The odometry as a ROS node: a thin shell around [`LidarOdometry`].

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};

use lattice_core::odometry::{LostCause, ScanResult, Verdict};
use lattice_msgs::geometry_msgs::Point;
use lattice_msgs::nav_msgs::{Odometry, Path};
use lattice_msgs::sensor_msgs::Imu;
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_msgs::visualization_msgs::{Marker, MarkerArray};
use nalgebra::Isometry3;

use super::live_loops::{LiveLoops, LoopState};
use super::parameters::Settings;
use super::path::ThinPath;
use super::{LidarOdometry, OdometryReport, Registered};
use crate::cloud_input::{CloudSubscriptions, Converted, SubscribedClouds, bytes_of};
use crate::compute::{Compute, Inbox};
use crate::convert::geometry;
use crate::report;
use crate::start::{Finish, NodeError};
use lattice_runtime::qos::Qos;
use lattice_runtime::{
    Diagnostics, Level, Losses, Node, Publisher, Runtime, SubscriptionExecutor, TfBroadcaster,
    TfGuard,
};

/// Event for the compute thread.
enum Event {
    Cloud(Converted),
    Transforms(Arc<TFMessage>, bool),
    Imu(Arc<Imu>),
    Wheels(Arc<Odometry>),
    /// Loops have changed.
    Loops,
    Finish,
}

/// Width of a line between both ends of a loop, m: seen from above a site.
const LINE_WIDTH_M: f64 = 0.2;

/// Topics of the clouds, of a gyroscope, and of wheel odometry.
const POINTS: &str = "points";
const IMU: &str = "imu";
const WHEELS: &str = "wheel_odometry";

/// Starts the node.
pub fn start(runtime: &Runtime, name: &str) -> Result<Finish, NodeError> {
    let node = runtime.node(name)?;
    let settings = Settings::from_params(node.params())?;
    let options = settings.odometry;
    let taken = format!(
        "clouds: {POINTS}; motion: {IMU}, {WHEELS}; poses: {} in {}; transforms: /tf, /tf_static",
        options.base_frame, options.odom_frame
    );
    let (lost, motion_lost) = (Arc::new(AtomicU64::new(0)), Arc::new(AtomicU64::new(0)));
    let losses = Losses::default();
    let odom_frame = options.odom_frame.clone();
    let guard = TfGuard::new(move |of, _| match of.child_frame_id == odom_frame {
        true => "map_frame: ''".to_owned(),
        false => "publish_tf: false".to_owned(),
    });
    let map_frame = settings.map_frame;
    let path_frame = match &map_frame {
        Some(map_frame) => map_frame,
        None => &options.odom_frame,
    };
    let woken: Arc<OnceLock<Inbox<Event>>> = Arc::default();
    let to_wake = Arc::clone(&woken);
    let on_change = move || {
        if let Some(inbox) = to_wake.get() {
            // Else the next scan publishes them.
            let _ = inbox.send(Event::Loops, 0);
        }
    };
    let mut shell = Shell {
        outputs: Outputs::open(
            &node,
            options.publish_tf.then_some(&guard),
            map_frame.is_some(),
        )?,
        path: ThinPath::new(path_frame),
        odom_frame: options.odom_frame.clone(),
        loops: match map_frame {
            Some(map_frame) => Some((LiveLoops::start(on_change)?, map_frame)),
            None => None,
        },
        version: 0,
        machine: LidarOdometry::new(options),
        diagnostics: node.diagnostics(),
        lost: Arc::clone(&lost),
        motion_lost: Arc::clone(&motion_lost),
        losses: losses.clone(),
        report_file: settings.report_file,
    };
    let compute = Compute::spawn(
        name,
        settings.limits,
        runtime.shutdown_handle(),
        move |event| shell.on(event),
    )?;
    let inbox = compute.inbox();
    woken.get_or_init(|| inbox.clone());
    let mut transforms = Vec::new();
    for (topic, qos, is_static) in [
        ("/tf", Qos::TF, false),
        ("/tf_static", Qos::TF_STATIC_LISTENER, true),
    ] {
        let (inbox, guard) = (inbox.clone(), guard.clone());
        // Transforms count no bytes: clouds must not keep them out.
        let handler = move |message: Arc<TFMessage>| {
            guard.on_message(&message, is_static);
            if !inbox.send(Event::Transforms(message, is_static), 0) {
                log::warn!("the inbox is full: transforms are lost");
            }
        };
        transforms.push(node.subscribe(topic, qos, SubscriptionExecutor::Shared, handler)?);
    }
    let to_inbox = inbox.clone();
    let of_clouds = SubscribedClouds {
        topics: vec![POINTS.to_owned()],
        parameter: None,
        losses: vec![losses],
        hand_over: Box::new(move |_, cloud| {
            let bytes = bytes_of(&cloud);
            let sent = to_inbox.send(Event::Cloud(cloud), bytes);
            lost.fetch_add(u64::from(!sent), Ordering::Relaxed);
        }),
    };
    let clouds = CloudSubscriptions::start(runtime, &node, of_clouds)?;
    let on_imu = inbox.counting(&motion_lost, Event::Imu, |_| 0);
    let on_wheels = inbox.counting(&motion_lost, Event::Wheels, |_| 0);
    let motion = (
        node.subscribe(IMU, Qos::INS, SubscriptionExecutor::Shared, on_imu)?,
        node.subscribe(WHEELS, Qos::INS, SubscriptionExecutor::Shared, on_wheels)?,
    );
    log::info!("{taken}");
    Ok(Box::new(move || {
        drop((clouds, motion, transforms));
        compute.finish_with(Event::Finish);
        Box::new(())
    }))
}

/// The topics of the node.
struct Outputs {
    odometry: Publisher<Odometry>,
    /// Poses to map with.
    odometry_ok: Publisher<Odometry>,
    path: Publisher<Path>,
    tf: Option<TfBroadcaster>,
    /// Present if loops are sought.
    corrected: Option<CorrectedOutputs>,
}

/// The topics of loops.
struct CorrectedOutputs {
    corrections: Publisher<TFMessage>,
    loop_closures: Publisher<MarkerArray>,
}

impl Outputs {
    /// `guard`: of the transforms, if they are published.
    fn open(node: &Node, guard: Option<&TfGuard>, has_loops: bool) -> Result<Self, NodeError> {
        let corrected = || -> Result<CorrectedOutputs, NodeError> {
            Ok(CorrectedOutputs {
                corrections: node.publisher("corrections", Qos::LATCHED)?,
                loop_closures: node.publisher("loop_closures", Qos::LATCHED)?,
            })
        };
        Ok(Self {
            odometry: node.publisher("odometry", Qos::DEFAULT)?,
            odometry_ok: node.publisher("odometry_ok", Qos::DEFAULT)?,
            path: node.publisher("path", Qos::LATCHED)?,
            tf: guard
                .map(|guard| TfBroadcaster::new(node, guard))
                .transpose()?,
            corrected: has_loops.then(corrected).transpose()?,
        })
    }
}

/// Lines between both ends of the loops that closed, in one marker.
fn markers(state: &LoopState, map_frame: &str, stamp_ns: i64) -> MarkerArray {
    let point = |p: &nalgebra::Vector3<f64>| Point {
        x: p.x,
        y: p.y,
        z: p.z,
    };
    let mut marker = Marker {
        header: geometry::header(map_frame, stamp_ns),
        ns: "loop_closures".to_owned(),
        type_: Marker::LINE_LIST,
        // A list of lines without points is an error to viewers.
        action: match state.lines_m.is_empty() {
            true => Marker::DELETE,
            false => Marker::ADD,
        },
        pose: geometry::pose_from(&Isometry3::identity()),
        points: state.lines_m.iter().flatten().map(point).collect(),
        ..Marker::default()
    };
    marker.scale.x = LINE_WIDTH_M;
    (marker.color.g, marker.color.a) = (1.0, 1.0);
    MarkerArray {
        markers: vec![marker],
    }
}

/// State of the compute thread.
struct Shell {
    machine: LidarOdometry,
    outputs: Outputs,
    path: ThinPath,
    odom_frame: String,
    /// Loops and the frame of the map, if they are sought.
    loops: Option<(LiveLoops, String)>,
    /// Version of the corrections that were published last.
    version: u64,
    diagnostics: Diagnostics,
    /// Clouds that found the inbox full, and losses before it.
    lost: Arc<AtomicU64>,
    motion_lost: Arc<AtomicU64>,
    losses: Losses,
    report_file: String,
}

impl Shell {
    fn on(&mut self, event: Event) {
        match event {
            Event::Cloud(cloud) => {
                let refused = self.machine.counts().clouds_refused();
                let found = match cloud {
                    Ok(cloud) => self.machine.on_cloud(POINTS, &cloud, 0),
                    Err(error) => {
                        self.machine.on_unconverted(POINTS, &error);
                        Vec::new()
                    }
                };
                found.iter().for_each(|found| self.publish(found));
                if self.machine.counts().clouds_refused() > refused {
                    self.diagnose(None);
                }
            }
            Event::Imu(imu) => {
                let found = self.machine.on_imu(IMU, &imu);
                found.iter().for_each(|found| self.publish(found));
            }
            Event::Wheels(wheels) => {
                let found = self.machine.on_wheels(WHEELS, &wheels);
                found.iter().for_each(|found| self.publish(found));
            }
            Event::Transforms(message, is_static) => self.machine.on_tf(&message, is_static),
            Event::Loops => self.correct(false),
            Event::Finish => self.finish(),
        }
    }

    fn publish(&mut self, found: &Registered) {
        let result = &found.result;
        if let Some((loops, _)) = &mut self.loops {
            loops.on_scan(found);
        }
        let is_lost = matches!(result.verdict, Verdict::Lost(_));
        let is_longer = !is_lost && self.path.add(result.end_ns, &result.odom_from_base);
        // Before the poses: who maps by them needs the place of their submap.
        self.correct(is_longer);
        let odometry = Arc::new(self.machine.message(result));
        let mut published = vec![self.outputs.odometry.publish(odometry)];
        for pose in self.machine.certain(result) {
            published.push(self.outputs.odometry_ok.publish(Arc::new(pose)));
        }
        if let Some(tf) = &self.outputs.tf {
            let mut transforms = vec![self.machine.transform(result)];
            transforms.extend(self.loops.as_ref().map(|(loops, map_frame)| {
                let (stamp_ns, odom) = (result.end_ns, &self.odom_frame);
                let map_from_odom = loops.map_from_odom(stamp_ns);
                geometry::transform_stamped(map_frame, odom, stamp_ns, &map_from_odom)
            }));
            published.push(tf.send(transforms));
        }
        for error in published.into_iter().filter_map(Result::err) {
            log::debug!("not published: {error}");
        }
        self.diagnose(Some(result));
    }

    /// Publishes corrections that are new, and the path if they are or if it is longer.
    fn correct(&mut self, is_longer: bool) {
        let newer = self
            .loops
            .as_ref()
            .and_then(|(loops, map_frame)| Some((loops.newer_than(self.version)?, map_frame)));
        let mut published = Vec::new();
        if let (Some((state, map_frame)), Some(outputs)) = (&newer, &self.outputs.corrected) {
            self.version = state.version;
            let corrections = state.corrections.message(map_frame, &self.odom_frame);
            let newest_ns = corrections.transforms.last();
            let newest_ns = newest_ns.map_or(0, |newest| newest.header.stamp.to_ns());
            let lines = markers(state, map_frame, newest_ns);
            published.push(outputs.corrections.publish(Arc::new(corrections)));
            published.push(outputs.loop_closures.publish(Arc::new(lines)));
        }
        if is_longer || newer.is_some() {
            let path = self.path.message(|stamp_ns| match &self.loops {
                Some((loops, _)) => loops.map_from_odom(stamp_ns),
                None => Isometry3::identity(),
            });
            published.push(self.outputs.path.publish(Arc::new(path)));
        }
        for error in published.into_iter().filter_map(Result::err) {
            log::debug!("not published: {error}");
        }
    }

    fn report(&self) -> OdometryReport {
        let loops = self.loops.as_ref().map(|(loops, _)| loops);
        let [loops_closed, loops_refused] = loops.map(LiveLoops::counts).unwrap_or_default();
        OdometryReport {
            counts: self.machine.counts().clone(),
            loops_closed,
            loops_refused,
            segments_queue_full: loops.map_or(0, |loops| loops.segments_queue_full),
            clouds_inbox_full: self.lost.load(Ordering::Relaxed) + self.losses.overrun(),
            motion_inbox_full: self.motion_lost.load(Ordering::Relaxed),
            clouds_lost_on_network: self.losses.on_network(),
            undecodable: self.losses.undecodable(),
            refusals: self.machine.refusals().to_vec(),
            notes: self.machine.notes().to_vec(),
        }
    }

    fn diagnose(&self, result: Option<&ScanResult>) {
        let is_elsewhere = |result: &ScanResult| {
            let loops = self.loops.as_ref();
            loops.is_some_and(|(loops, _)| !loops.is_placed(result.submap))
        };
        let (level, message) = match result.map(|result| &result.verdict) {
            Some(Verdict::Ok) if result.is_some_and(is_elsewhere) => {
                let text = "OK in a submap whose place in the map is unknown until a loop joins it";
                (Level::Warn, text.to_owned())
            }
            Some(Verdict::Ok) => (Level::Ok, "OK".to_owned()),
            Some(Verdict::Weak(directions)) => {
                let text = format!("WEAK: {} motions are predicted", directions.len());
                (Level::Warn, text)
            }
            // As of every machine at rest when it starts.
            Some(Verdict::Lost(cause @ LostCause::OnePlace)) => {
                (Level::Warn, format!("LOST: {cause}"))
            }
            Some(Verdict::Lost(cause)) => (Level::Error, format!("LOST: {cause}")),
            None => {
                let newest = self.machine.refusals().last();
                let text = newest.map_or(String::new(), |refusal| refusal.text.clone());
                (Level::Warn, format!("cloud dropped: {text}"))
            }
        };
        let mut values = report::key_values(&self.report());
        if let Some(result) = result {
            values.push(("submap".into(), result.submap.to_string()));
            values.push(("overlap".into(), format!("{:.3}", result.overlap)));
            values.push(("contrast".into(), format!("{:.1}", result.contrast)));
        }
        self.diagnostics.set("odometry", level, message, values);
    }

    fn finish(&mut self) {
        let found = self.machine.finish();
        found.iter().for_each(|found| self.publish(found));
        let report = self.report();
        let counts = &report.counts;
        log::info!(
            "{} clouds in, {} OK, {} WEAK, {} LOST, {:.1} m, {} loops closed",
            counts.clouds_in,
            counts.scans_ok,
            counts.scans_weak,
            counts.scans_lost(),
            counts.path_m,
            report.loops_closed
        );
        if let Err(error) = report::write(&self.report_file, &report, &self.diagnostics) {
            log::error!("{error}");
        }
    }
}
