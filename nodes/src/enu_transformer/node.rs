//! ROS node around [`EnuTransformer`].

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use lattice_msgs::RosMessage;
use lattice_msgs::geographic_msgs::GeoPointStamped;
use lattice_msgs::geometry_msgs::{PoseStamped, PoseWithCovarianceStamped, TransformStamped};
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::novatel_oem7_msgs::{INSPVA, INSPVAX};
use lattice_msgs::sensor_msgs::{Imu, NavSatFix, PointCloud2};
use lattice_msgs::tf2_msgs::TFMessage;

use super::ins::{InsMessage, InsSource};
use super::parameters::Settings;
use super::{EnuOutput, EnuTransformer, TransformerOptions, TransformerReport, most_frequent};
use crate::cloud_input::{CloudSubscriptions, Converted, SubscribedClouds, bytes_of};
use crate::compute::{Compute, Inbox};
use crate::report;
use crate::start::{Finish, LAST_FLUSH, NodeError, handed_over, open_params};
use lattice_runtime::logging::Throttle;
use lattice_runtime::qos::Qos;
use lattice_runtime::{
    Activity, Clock, Diagnostics, Level, Losses, Node, Publisher, Runtime, StaticTfBroadcaster,
    Subscription, SubscriptionExecutor, TfBroadcaster, TfGuard,
};

/// Event for the compute thread.
enum Event {
    Cloud(Arc<str>, Converted),
    Transforms(Arc<TFMessage>, bool),
    Inspva(Arc<INSPVA>),
    Inspvax(Arc<INSPVAX>),
    Fix(Arc<NavSatFix>),
    Imu(Arc<Imu>),
    Odometry(Arc<Odometry>),
    Pose(Arc<PoseStamped>),
    PoseWithCovariance(Arc<PoseWithCovarianceStamped>),
    Tick,
    Settings(Box<TransformerOptions>),
    Finish,
}

/// Starts the node.
pub fn start(runtime: &Runtime, name: &str) -> Result<Finish, NodeError> {
    let node = runtime.node(name)?;
    let params = node.params();
    let settings = Settings::from_params(params)?;
    // Not a part of the declaration: a replay reads it before it knows the source.
    if let Some(name) = settings.transformer.ins.ignored() {
        let problem = format!(
            "`ins.source: {}` ignores it",
            settings.transformer.ins.source
        );
        return Err(params.invalid(name, problem).into());
    }
    let taken = settings.taken();
    let source = settings.transformer.ins.source;
    let guard = TfGuard::new(remedy(&settings.transformer));
    let [lost, lost_poses] = [(); 2].map(|()| Arc::new(AtomicU64::new(0)));
    let (lost_clouds, losses) = (Losses::default(), Losses::default());
    let mut compute_state = ComputeState {
        activity: node.activity(),
        lost_clouds: lost_clouds.clone(),
        losses: losses.clone(),
        machine: EnuTransformer::new(settings.transformer),
        outputs: Outputs::open(&node, &guard)?,
        clock: node.clock(),
        diagnostics: node.diagnostics(),
        lost: Arc::clone(&lost),
        lost_poses: Arc::clone(&lost_poses),
        topics: InsTopics {
            ins: settings.ins_topic.clone(),
            imu: settings.imu_topic.clone(),
        },
        report_file: settings.report_file,
    };
    let compute = Compute::spawn(
        name,
        settings.limits,
        runtime.shutdown_handle(),
        move |event| compute_state.on(event),
    )?;
    let inbox = compute.inbox();
    let poses = PoseInbox {
        inbox: inbox.clone(),
        lost: lost_poses,
    };
    // Before the poses: transforms of others decide which ones are published.
    let transforms = poses.subscribe_tf(&node, &guard)?;
    let (ins, imu) = (&settings.ins_topic, &settings.imu_topic);
    let mut inputs = poses.subscribe_ins(&node, source, ins, imu)?;
    let of_ins = Some("ins.source and ins.topic");
    node.expect_publishers(&inputs, "the driver of the INS", of_ins, |_| true);
    inputs.extend(transforms);
    losses.watch(&inputs);
    let to_inbox = inbox.clone();
    let of_clouds = SubscribedClouds {
        topics: settings.points_topics,
        parameter: Some("points_topics"),
        losses: vec![lost_clouds, losses],
        hand_over: Box::new(move |topic, cloud| {
            let bytes = bytes_of(&cloud);
            let sent = to_inbox.send(Event::Cloud(Arc::clone(topic), cloud), bytes);
            lost.fetch_add(u64::from(!sent), Ordering::Relaxed);
        }),
    };
    let clouds = CloudSubscriptions::start(runtime, &node, of_clouds)?;
    let period = Duration::from_millis(200);
    let ticks = inbox.ticks((runtime, &node), period, || Event::Tick);
    log::info!("{taken}");
    open_params(params, move |params| {
        let settings = Settings::from_params(params).map_err(|error| error.to_string())?;
        handed_over(inbox.send(Event::Settings(Box::new(settings.transformer)), 0))
    });
    Ok(Box::new(move || {
        drop((inputs, clouds, ticks));
        compute.finish_with(Event::Finish);
        Box::new(())
    }))
}

/// Parameter to set where another node publishes the parent of a frame of ours.
fn remedy(options: &TransformerOptions) -> impl Fn(&TransformStamped, &str) -> String + use<> {
    let (map, base) = (options.map_frame.clone(), options.base_frame.clone());
    move |ours, root| match &ours.child_frame_id {
        child if *child == base && root != map => {
            format!("odom_frame: {root} to publish {map} -> {root}, or publish_tf: false")
        }
        child if *child == map => "publish_tf: false if none below it is wanted".to_owned(),
        _ => "publish_tf: false".to_owned(),
    }
}

/// Inbox for poses and transforms, with the count of rejected ones.
struct PoseInbox {
    inbox: Inbox<Event>,
    lost: Arc<AtomicU64>,
}

impl PoseInbox {
    fn subscribe_ins(
        &self,
        node: &Node,
        source: InsSource,
        topic: &str,
        imu: &str,
    ) -> Result<Vec<Subscription>, NodeError> {
        let ins = match source {
            InsSource::Tf => return Ok(Vec::new()),
            InsSource::Inspva => self.subscribe(node, topic, Qos::INS, Event::Inspva),
            InsSource::Inspvax => self.subscribe(node, topic, Qos::INS, Event::Inspvax),
            InsSource::Odometry => self.subscribe(node, topic, Qos::INS, Event::Odometry),
            InsSource::Pose => self.subscribe(node, topic, Qos::INS, Event::Pose),
            InsSource::PoseWithCovariance => {
                self.subscribe(node, topic, Qos::INS, Event::PoseWithCovariance)
            }
            InsSource::NavsatfixImu => {
                let fix = self.subscribe(node, topic, Qos::INS, Event::Fix)?;
                let imu = self.subscribe(node, imu, Qos::INS, Event::Imu)?;
                return Ok(vec![fix, imu]);
            }
        };
        Ok(vec![ins?])
    }

    fn subscribe_tf(&self, node: &Node, guard: &TfGuard) -> Result<[Subscription; 2], NodeError> {
        let subscribe = |topic, qos, is_static| {
            let guard = guard.clone();
            self.subscribe(node, topic, qos, move |message| {
                guard.on_message(&message, is_static);
                Event::Transforms(message, is_static)
            })
        };
        Ok([
            subscribe("/tf", Qos::TF, false)?,
            subscribe("/tf_static", Qos::TF_STATIC_LISTENER, true)?,
        ])
    }

    fn subscribe<M: RosMessage>(
        &self,
        node: &Node,
        topic: &str,
        qos: Qos,
        event: impl Fn(Arc<M>) -> Event + Send + 'static,
    ) -> Result<Subscription, NodeError> {
        // Poses count no bytes: clouds must not displace them.
        let (inbox, lost) = (self.inbox.clone(), Arc::clone(&self.lost));
        let warnings = Throttle::new(Duration::from_secs(5));
        let handler = move |message: Arc<M>| {
            if !inbox.send(event(message), 0) {
                let all = lost.fetch_add(1, Ordering::Relaxed) + 1;
                if warnings.check().is_some() {
                    log::warn!("the inbox is full: {all} poses and transforms lost so far");
                }
            }
        };
        Ok(node.subscribe(topic, qos, SubscriptionExecutor::Shared, handler)?)
    }
}

/// Publishers of the node.
struct Outputs {
    points: Publisher<PointCloud2>,
    tf: TfBroadcaster,
    tf_static: StaticTfBroadcaster,
    origin: Publisher<GeoPointStamped>,
}

impl Outputs {
    fn open(node: &Node, guard: &TfGuard) -> Result<Self, NodeError> {
        Ok(Self {
            points: node.publisher("points_enu", Qos::SCANS)?,
            tf: TfBroadcaster::new(node, guard)?,
            tf_static: StaticTfBroadcaster::new(node, guard)?,
            origin: node.publisher("map_origin", Qos::LATCHED)?,
        })
    }
}

/// Topics of the INS, for rejection texts.
struct InsTopics {
    ins: String,
    imu: String,
}

/// State of the compute thread.
struct ComputeState {
    activity: Activity,
    machine: EnuTransformer,
    outputs: Outputs,
    clock: Clock,
    diagnostics: Diagnostics,
    /// Clouds rejected by a full inbox.
    lost: Arc<AtomicU64>,
    /// Losses before the inbox: of clouds, and of all inputs.
    lost_clouds: Losses,
    losses: Losses,
    /// Poses and transforms rejected by a full inbox.
    lost_poses: Arc<AtomicU64>,
    topics: InsTopics,
    report_file: String,
}

impl ComputeState {
    fn on(&mut self, event: Event) {
        let now_ns = self.clock.now_ns();
        let machine = &mut self.machine;
        let topics = &self.topics;
        let mut ins = |topic: &str, message| machine.on_ins(topic, message, now_ns);
        let outputs = match event {
            Event::Cloud(topic, Ok(cloud)) => machine.on_cloud(&topic, cloud, now_ns),
            Event::Cloud(topic, Err(error)) => {
                machine.on_unconverted(&topic, &error);
                Vec::new()
            }
            Event::Transforms(m, is_static) => machine.on_tf(&m, is_static, now_ns),
            Event::Inspva(m) => ins(&topics.ins, InsMessage::Inspva(&m)),
            Event::Inspvax(m) => ins(&topics.ins, InsMessage::Inspvax(&m)),
            Event::Fix(m) => ins(&topics.ins, InsMessage::Fix(&m)),
            Event::Imu(m) => ins(&topics.imu, InsMessage::Imu(&m)),
            Event::Odometry(m) => ins(&topics.ins, InsMessage::Odometry(&m)),
            Event::Pose(m) => ins(&topics.ins, InsMessage::Pose(&m)),
            Event::PoseWithCovariance(m) => ins(&topics.ins, InsMessage::PoseWithCovariance(&m)),
            Event::Tick => {
                let outputs = machine.tick(now_ns);
                if machine.is_waiting() {
                    self.activity.note();
                }
                self.diagnose();
                outputs
            }
            Event::Settings(options) => {
                machine.set_options(*options);
                machine.tick(now_ns)
            }
            Event::Finish => {
                self.finish();
                return;
            }
        };
        for output in outputs {
            self.publish(output);
        }
    }

    fn publish(&mut self, output: EnuOutput) {
        let published = match output {
            EnuOutput::Points(points) => self.outputs.points.publish(points),
            EnuOutput::Transform(transform) => self.outputs.tf.send(vec![transform]),
            EnuOutput::StaticTransform(transform) => self.outputs.tf_static.send([transform]),
            EnuOutput::Origin(origin) => self.outputs.origin.publish(Arc::new(origin)),
        };
        if let Err(error) = published {
            log::debug!("not published: {error}");
        }
    }

    fn report(&self) -> TransformerReport {
        TransformerReport {
            counts: self.machine.counts().clone(),
            clouds_inbox_full: self.lost.load(Ordering::Relaxed) + self.lost_clouds.overrun(),
            clouds_lost_on_network: self.lost_clouds.on_network(),
            poses_inbox_full: self.lost_poses.load(Ordering::Relaxed)
                + self
                    .losses
                    .overrun()
                    .saturating_sub(self.lost_clouds.overrun()),
            poses_lost_on_network: (self.losses.on_network())
                .saturating_sub(self.lost_clouds.on_network()),
            undecodable: self.losses.undecodable(),
            clouds_not_published: self.outputs.points.dropped(),
            refusals: self.machine.refusals().all().to_vec(),
            notes: self.machine.notes().to_vec(),
            attitude: self.machine.attitude(),
        }
    }

    fn diagnose(&self) {
        let report = self.report();
        let dropped = report.dropped();
        let dropped: Vec<String> = dropped.iter().map(|(r, n)| format!("{n} {r}")).collect();
        let dropped = dropped.join(", ");
        let (level, message) = match report.cause_of_nothing() {
            Some(cause) => (Level::Warn, cause),
            None if report.attitude.is_some() => {
                let attitude = report.attitude.clone();
                let is_wrong = attitude.as_ref().is_some_and(|found| found.is_impossible);
                let level = if is_wrong { Level::Error } else { Level::Warn };
                (level, attitude.map_or(String::new(), |found| found.text))
            }
            None if dropped.is_empty() => (Level::Ok, "transforming".to_owned()),
            None => {
                let text = most_frequent(&report.refusals, "clouds_");
                let text = text.map_or(String::new(), |r| format!("; {}: {}", r.topic, r.text));
                (Level::Warn, format!("clouds dropped: {dropped}{text}"))
            }
        };
        let mut values = report::key_values(&report);
        values.push(("clouds_waiting".into(), self.machine.waiting().to_string()));
        self.diagnostics.set("clouds", level, message, values);
    }

    fn finish(&mut self) {
        for output in self.machine.finish() {
            self.publish(output);
        }
        self.outputs.points.flush(LAST_FLUSH);
        let report = self.report();
        let (clouds_in, clouds_out) = (report.counts.clouds_in, report.counts.clouds_out);
        let dropped = report.dropped();
        log::info!("{clouds_in} clouds in, {clouds_out} out, dropped: {dropped:?}");
        if let Err(error) = report::write(&self.report_file, &report, &self.diagnostics) {
            log::error!("{error}");
        }
    }
}
