//! The odometry as a ROS node: a thin shell around [`LidarOdometry`].

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use lattice_core::odometry::{LostCause, ScanResult, Verdict};
use lattice_msgs::nav_msgs::{Odometry, Path};
use lattice_msgs::sensor_msgs::Imu;
use lattice_msgs::tf2_msgs::TFMessage;

use super::parameters::Settings;
use super::path::ThinPath;
use super::{LidarOdometry, OdometryReport};
use crate::cloud_input::{CloudSubscriptions, Converted, SubscribedClouds, bytes_of};
use crate::compute::Compute;
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
    Finish,
}

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
    let guard = TfGuard::new(|_, _| "publish_tf: false".to_owned());
    let mut shell = Shell {
        outputs: Outputs::open(&node, options.publish_tf.then_some(&guard))?,
        path: ThinPath::new(&options.odom_frame),
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
}

impl Outputs {
    /// `guard`: of the transforms, if they are published.
    fn open(node: &Node, guard: Option<&TfGuard>) -> Result<Self, NodeError> {
        Ok(Self {
            odometry: node.publisher("odometry", Qos::DEFAULT)?,
            odometry_ok: node.publisher("odometry_ok", Qos::DEFAULT)?,
            path: node.publisher("path", Qos::LATCHED)?,
            tf: guard
                .map(|guard| TfBroadcaster::new(node, guard))
                .transpose()?,
        })
    }
}

/// State of the compute thread.
struct Shell {
    machine: LidarOdometry,
    outputs: Outputs,
    path: ThinPath,
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
                found
                    .into_iter()
                    .for_each(|found| self.publish(&found.result));
                if self.machine.counts().clouds_refused() > refused {
                    self.diagnose(None);
                }
            }
            Event::Imu(imu) => {
                let found = self.machine.on_imu(IMU, &imu);
                found
                    .into_iter()
                    .for_each(|found| self.publish(&found.result));
            }
            Event::Wheels(wheels) => {
                let found = self.machine.on_wheels(WHEELS, &wheels);
                found
                    .into_iter()
                    .for_each(|found| self.publish(&found.result));
            }
            Event::Transforms(message, is_static) => self.machine.on_tf(&message, is_static),
            Event::Finish => self.finish(),
        }
    }

    fn publish(&mut self, result: &ScanResult) {
        let odometry = Arc::new(self.machine.message(result));
        let mut published = vec![self.outputs.odometry.publish(odometry)];
        for pose in self.machine.certain(result) {
            published.push(self.outputs.odometry_ok.publish(Arc::new(pose)));
        }
        if let Some(tf) = &self.outputs.tf {
            published.push(tf.send(vec![self.machine.transform(result)]));
        }
        let is_lost = matches!(result.verdict, Verdict::Lost(_));
        let path = match is_lost {
            true => None,
            false => self.path.add(result.end_ns, &result.odom_from_base),
        };
        published.extend(path.map(|path| self.outputs.path.publish(Arc::new(path))));
        for error in published.into_iter().filter_map(Result::err) {
            log::debug!("not published: {error}");
        }
        self.diagnose(Some(result));
    }

    fn report(&self) -> OdometryReport {
        OdometryReport {
            counts: self.machine.counts().clone(),
            clouds_inbox_full: self.lost.load(Ordering::Relaxed) + self.losses.overrun(),
            motion_inbox_full: self.motion_lost.load(Ordering::Relaxed),
            clouds_lost_on_network: self.losses.on_network(),
            undecodable: self.losses.undecodable(),
            refusals: self.machine.refusals().to_vec(),
            notes: self.machine.notes().to_vec(),
        }
    }

    fn diagnose(&self, result: Option<&ScanResult>) {
        let (level, message) = match result.map(|result| &result.verdict) {
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
        found
            .into_iter()
            .for_each(|found| self.publish(&found.result));
        let report = self.report();
        let counts = &report.counts;
        log::info!(
            "{} clouds in, {} OK, {} WEAK, {} LOST, {:.1} m",
            counts.clouds_in,
            counts.scans_ok,
            counts.scans_weak,
            counts.scans_lost(),
            counts.path_m
        );
        if let Err(error) = report::write(&self.report_file, &report, &self.diagnostics) {
            log::error!("{error}");
        }
    }
}
