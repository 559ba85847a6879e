//! ROS node around [`HeadsetCloud`].

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use lattice_msgs::geometry_msgs::PoseStamped;
use lattice_msgs::lattice::HeadsetMesh;
use lattice_msgs::sensor_msgs::{CameraInfo, Image, PointCloud2};
use lattice_msgs::std_msgs;
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_msgs::vision_msgs::LabelInfo;
use lattice_msgs::visualization_msgs::Marker;

use super::parameters::Settings;
use super::{
    HeadsetCloud, HeadsetOptions, HeadsetOutput, HeadsetReport, HeadsetStream, LabelsFrom,
    MeshOptions, PoseSource,
};
use crate::compute::{Compute, Inbox};
use crate::mesh::read_mesh_in;
use crate::report;
use crate::segmenter::{self, LoadedNetwork, NetworkEvent, NetworkView, Worker};
use crate::start::{Finish, LAST_FLUSH, NodeError, handed_over, open_params};
use lattice_runtime::logging::Throttle;
use lattice_runtime::qos::Qos;
use lattice_runtime::{
    Diagnostics, Level, Losses, Node, Publisher, Runtime, Subscription, SubscriptionExecutor,
};

/// Event for the compute thread.
enum Event {
    Mesh(Arc<HeadsetMesh>),
    Marker(Arc<Marker>),
    Session(Arc<std_msgs::String>),
    Image(HeadsetStream, Arc<Image>),
    CameraInfo(Arc<CameraInfo>),
    LabelInfo(Arc<LabelInfo>),
    Pose(Arc<PoseStamped>),
    Transforms(Arc<TFMessage>, bool),
    /// Event of the built-in network.
    Network(NetworkEvent),
    Tick,
    Settings(Box<HeadsetOptions>),
    Finish,
}

/// Starts the node.
pub fn start(runtime: &Runtime, name: &str) -> Result<Finish, NodeError> {
    let node = runtime.node(name)?;
    let params = node.params();
    let settings = Settings::from_params(params)?;
    let mut machine = HeadsetCloud::new(settings.headset.clone());
    if !settings.mesh_file.is_empty() {
        let MeshOptions {
            axes,
            max_triangles,
            ..
        } = settings.headset.mesh;
        let read = read_mesh_in(Path::new(&settings.mesh_file), axes, max_triangles);
        let taken = match &read {
            Ok(mesh) => machine.on_mesh_file(mesh).map_err(|e| e.to_string()),
            Err(error) => Err(error.to_string()),
        };
        taken.map_err(|problem| params.invalid("mesh_file", problem))?;
    }
    let ready = match &settings.network {
        Some((network, options)) => Some(LoadedNetwork::new(
            params,
            network,
            options.clone(),
            &runtime.shutdown_handle(),
        )?),
        None => None,
    };
    let (lost, losses) = (Arc::new(AtomicU64::new(0)), Losses::default());
    let mut compute_state = ComputeState {
        machine,
        points: node.publisher("headset/points", Qos::SCANS)?,
        label_info: node.publisher("headset/label_info", Qos::LATCHED)?,
        session: node.publisher("headset/session", Qos::LATCHED)?,
        network: ready.as_ref().map(LoadedNetwork::view),
        diagnostics: node.diagnostics(),
        lost: Arc::clone(&lost),
        losses: losses.clone(),
        warnings: Throttle::new(Duration::from_secs(5)),
        begin: Instant::now(),
        warned: 0,
        report_file: settings.report_file.clone(),
    };
    compute_state.publish_names();
    let shutdown = runtime.shutdown_handle();
    let compute = Compute::spawn(name, settings.limits, shutdown.clone(), move |event| {
        compute_state.on(event)
    })?;
    let inbox = compute.inbox();
    let mut inputs = subscribe(&node, &inbox, &lost, &settings)?;
    let mut network = None;
    if let Some(ready) = ready {
        let names = [name, "headset/image"];
        let tell = segmenter::hand_over(&inbox, &lost, Event::Network);
        let (worker, images) =
            ready.start(&node, names, settings.compressed_color, shutdown, tell)?;
        inputs.push(images);
        network = Some(worker);
    }
    losses.watch(&inputs);
    let period = Duration::from_millis(500);
    let looks = inbox.ticks((runtime, &node), period, || Event::Tick);
    let set_network = network.as_ref().map(Worker::settings);
    open_params(params, move |params| {
        let settings = Settings::from_params(params).map_err(|error| error.to_string())?;
        if let (Some(set), Some((_, options))) = (&set_network, settings.network) {
            handed_over(set(options))?;
        }
        handed_over(inbox.send(Event::Settings(Box::new(settings.headset)), 0))
    });
    Ok(Box::new(move || {
        drop((inputs, looks));
        if let Some(network) = network {
            network.finish();
        }
        compute.finish_with(Event::Finish);
        Box::new(())
    }))
}

fn subscribe(
    node: &Node,
    inbox: &Inbox<Event>,
    lost: &Arc<AtomicU64>,
    settings: &Settings,
) -> Result<Vec<Subscription>, NodeError> {
    let size = |mesh: &Arc<HeadsetMesh>| {
        4 * (mesh.vertices.len() + mesh.triangles.len()) + 2 * mesh.classes.len()
    };
    let options = &settings.headset;
    let mesh = inbox.counting(lost, Event::Mesh, size);
    let marker = inbox.counting(lost, Event::Marker, |marker| 24 * marker.points.len());
    let session = inbox.counting(lost, Event::Session, |session| session.data.len());
    let mut inputs = vec![
        node.subscribe(
            "headset/mesh",
            Qos::reliable(1000),
            SubscriptionExecutor::Dedicated,
            mesh,
        )?,
        node.subscribe(
            "headset/mesh_marker",
            Qos::reliable(1000),
            SubscriptionExecutor::Dedicated,
            marker,
        )?,
        node.subscribe(
            "headset/session",
            Qos::LATCHED,
            SubscriptionExecutor::Shared,
            session,
        )?,
    ];
    if settings.network.is_none() {
        let names = inbox.counting(lost, Event::LabelInfo, |_| 0);
        let topic = "headset/labels/label_info";
        inputs.push(node.subscribe(topic, Qos::LATCHED, SubscriptionExecutor::Shared, names)?);
    }
    if options.labels_from == LabelsFrom::Mesh {
        return Ok(inputs);
    }
    let bytes = |image: &Arc<Image>| size_of::<Image>() + image.data.len();
    if settings.network.is_none() {
        let labels = |image| Event::Image(HeadsetStream::Labels, image);
        let labels = inbox.counting(lost, labels, bytes);
        inputs.push(node.subscribe(
            "headset/labels/image",
            Qos::SENSOR,
            SubscriptionExecutor::Dedicated,
            labels,
        )?);
    }
    if options.use_confidence {
        let confidence = |image| Event::Image(HeadsetStream::Confidence, image);
        let confidence = inbox.counting(lost, confidence, bytes);
        let topic = "headset/labels/confidence";
        inputs.push(node.subscribe(
            topic,
            Qos::SENSOR,
            SubscriptionExecutor::Dedicated,
            confidence,
        )?);
    }
    let camera = inbox.counting(lost, Event::CameraInfo, |_| 0);
    inputs.push(node.subscribe(
        "headset/camera_info",
        Qos::SENSOR,
        SubscriptionExecutor::Shared,
        camera,
    )?);
    match options.poses {
        PoseSource::Topic => {
            let pose = inbox.counting(lost, Event::Pose, |_| 0);
            inputs.push(node.subscribe(
                "headset/pose",
                Qos::INS,
                SubscriptionExecutor::Shared,
                pose,
            )?);
        }
        PoseSource::Tf => {
            let moving = inbox.counting(lost, |m| Event::Transforms(m, false), |_| 0);
            inputs.push(node.subscribe("/tf", Qos::TF, SubscriptionExecutor::Shared, moving)?);
            let fixed = inbox.counting(lost, |m| Event::Transforms(m, true), |_| 0);
            let latched = Qos::TF_STATIC_LISTENER;
            inputs.push(node.subscribe(
                "/tf_static",
                latched,
                SubscriptionExecutor::Shared,
                fixed,
            )?);
        }
    }
    Ok(inputs)
}

/// State of the compute thread.
struct ComputeState {
    machine: HeadsetCloud,
    points: Publisher<PointCloud2>,
    label_info: Publisher<LabelInfo>,
    session: Publisher<std_msgs::String>,
    network: Option<NetworkView>,
    diagnostics: Diagnostics,
    /// Messages rejected by the inbox or lost before it.
    lost: Arc<AtomicU64>,
    losses: Losses,
    warnings: Throttle,
    /// Start time of the node.
    begin: Instant,
    /// Dropped messages at the last warning.
    warned: u64,
    report_file: String,
}

impl ComputeState {
    fn on(&mut self, event: Event) {
        let machine = &mut self.machine;
        let elapsed = self.begin.elapsed().as_nanos();
        machine.at(i64::try_from(elapsed).unwrap_or(i64::MAX));
        let outputs = match event {
            Event::Mesh(mesh) => machine.on_mesh(&mesh),
            Event::Marker(marker) => machine.on_marker(&marker),
            Event::Session(session) => {
                machine.on_session(&session.data);
                return;
            }
            Event::Image(stream, image) => machine.on_image(stream, image),
            Event::CameraInfo(info) => machine.on_camera_info(info),
            Event::LabelInfo(info) => machine.on_label_info(info),
            Event::Pose(pose) => machine.on_pose(&pose),
            Event::Transforms(message, is_static) => machine.on_tf(&message, is_static),
            Event::Network(NetworkEvent::Labelled(labels)) => machine.on_labelled(labels),
            // Poses are kept longer than the processing of an image.
            Event::Network(NetworkEvent::Begun(_)) => return,
            Event::Network(NetworkEvent::Names) => {
                self.publish_names();
                return;
            }
            Event::Settings(options) => machine.set_options(*options),
            Event::Tick => {
                let outputs = machine.tick();
                self.diagnose();
                outputs
            }
            Event::Finish => {
                let outputs = machine.finish();
                self.publish(outputs);
                self.finish();
                return;
            }
        };
        self.publish(outputs);
    }

    /// Publishes the class names of the built-in network.
    fn publish_names(&mut self) {
        let info = self.network.as_ref().and_then(NetworkView::label_info);
        if let Some(info) = info {
            let outputs = self.machine.on_label_info(Arc::new(info));
            self.publish(outputs);
        }
    }

    fn publish(&self, outputs: Vec<HeadsetOutput>) {
        for output in outputs {
            let published = match output {
                HeadsetOutput::Points(points) => self.points.publish(Arc::new(points)),
                HeadsetOutput::LabelInfo(info) => self.label_info.publish(Arc::new(info)),
                HeadsetOutput::Session(data) => {
                    self.session.publish(Arc::new(std_msgs::String { data }))
                }
            };
            if let Err(error) = published {
                log::debug!("not published: {error}");
            }
        }
    }

    fn report(&self) -> HeadsetReport {
        HeadsetReport {
            counts: self.machine.counts().clone(),
            messages_lost: self.lost.load(Ordering::Relaxed) + self.losses.lost(),
            undecodable: self.losses.undecodable(),
            clouds_not_published: self.points.dropped(),
            network: self.network.as_ref().map(NetworkView::counts),
        }
    }

    fn diagnose(&mut self) {
        let report = HeadsetReport {
            network: None,
            ..self.report()
        };
        let counts = &report.counts;
        let dropped: u64 = counts.dropped.values().sum();
        let [surfaces, triangles] = self.machine.mesh_size();
        let message = if surfaces == 0 {
            "no mesh yet".to_owned()
        } else if counts.clouds_out == 0 && dropped == 0 {
            "no cloud yet".to_owned()
        } else if dropped == 0 {
            "making clouds".to_owned()
        } else {
            let reasons = counts.dropped.iter().map(|(r, n)| format!("{n} {r}"));
            let reasons: Vec<_> = reasons.collect();
            format!("dropped: {}", reasons.join(", "))
        };
        let is_good = surfaces > 0 && counts.clouds_out > 0 && dropped == 0;
        let level = if is_good { Level::Ok } else { Level::Warn };
        let problem = self.machine.problem().map(str::to_owned);
        if let Some(problem) = problem.as_ref().filter(|_| dropped > self.warned)
            && self.warnings.check().is_some()
        {
            self.warned = dropped;
            log::warn!("{message}; last rejection: {problem}");
        }
        let [images, chunked] = self.machine.waiting();
        let mut values = report::key_values(&report);
        for (name, number) in [
            ("surfaces", surfaces),
            ("triangles", triangles),
            ("images_waiting", images),
            ("surfaces_waiting", chunked),
        ] {
            values.push((name.into(), number.to_string()));
        }
        values.push(("last_refused".into(), problem.unwrap_or_default()));
        self.diagnostics.set("clouds", level, message, values);
        if let Some(network) = &self.network {
            network.diagnose(&self.diagnostics);
        }
    }

    fn finish(&mut self) {
        self.points.flush(LAST_FLUSH);
        let report = self.report();
        let counts = &report.counts;
        let (labels_in, clouds_out) = (counts.labels_in, counts.clouds_out);
        let dropped = &counts.dropped;
        log::info!("{labels_in} label images in, {clouds_out} clouds out, dropped: {dropped:?}");
        if let Err(error) = report::write(&self.report_file, &report, &self.diagnostics) {
            log::error!("{error}");
        }
    }
}
