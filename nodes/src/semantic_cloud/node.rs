//! ROS node around [`SemanticCloud`].

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use lattice_msgs::sensor_msgs::{CameraInfo, CompressedImage, Image, PointCloud2};
use lattice_msgs::vision_msgs::LabelInfo;

use super::network::Outputs;
use super::parameters::Settings;
use super::{CloudOptions, CloudOutput, CloudReport, SemanticCloud, Stream};
use crate::compute::{Compute, Inbox};
use crate::report;
use crate::segmenter::{self, LoadedNetwork, NetworkEvent, Worker};
use crate::start::{Finish, LAST_FLUSH, NodeError, handed_over, open_params};
use lattice_runtime::logging::Throttle;
use lattice_runtime::qos::Qos;
use lattice_runtime::{
    Diagnostics, Level, Losses, Node, Publisher, Runtime, Subscription, SubscriptionExecutor,
};

/// Limit of stored arrival times of depth images.
const MAX_ARRIVALS: usize = 256;
/// Topic of label images.
const LABELS: &str = "labels/image";
/// Topic of colour images.
const COLOR: &str = "rgb/image_rect_color";

/// Event for the compute thread.
enum Event {
    /// An image with its arrival time.
    Image(Stream, Arc<Image>, Instant),
    CompressedDepth(Arc<CompressedImage>, Instant),
    CompressedColor(Arc<CompressedImage>),
    CameraInfo(Arc<CameraInfo>),
    LabelInfo(Arc<LabelInfo>),
    /// Event of the built-in network.
    Network(NetworkEvent),
    Diagnose,
    Settings(Box<CloudOptions>),
    Finish,
}

/// Starts the node.
pub fn start(runtime: &Runtime, name: &str) -> Result<Finish, NodeError> {
    let node = runtime.node(name)?;
    let params = node.params();
    let settings = Settings::from_params(params)?;
    let (lost, losses) = (Arc::new(AtomicU64::new(0)), Losses::default());
    let ready = match &settings.network {
        Some((network, options)) => Some(LoadedNetwork::new(
            params,
            network,
            options.clone(),
            &runtime.shutdown_handle(),
        )?),
        None => None,
    };
    let view = ready.as_ref().map(LoadedNetwork::view);
    let has_label_source = Arc::new(AtomicBool::new(false));
    let mut compute_state = ComputeState {
        machine: SemanticCloud::new(settings.cloud.clone()),
        has_label_source: Arc::clone(&has_label_source),
        is_unlabelled: false,
        points: node.publisher("points", Qos::SCANS)?,
        label_info: node.publisher("label_info", Qos::LATCHED)?,
        network: view.map(|view| Outputs::new(&node, view)).transpose()?,
        diagnostics: node.diagnostics(),
        lost: Arc::clone(&lost),
        losses: losses.clone(),
        arrivals: VecDeque::new(),
        last_latency_s: 0.0,
        warnings: Throttle::new(Duration::from_secs(5)),
        warned: 0,
        report_file: settings.report_file.clone(),
    };
    compute_state.publish_names();
    let shutdown = runtime.shutdown_handle();
    let compute = Compute::spawn(name, settings.limits, shutdown.clone(), move |event| {
        compute_state.on(event)
    })?;
    let inbox = compute.inbox();
    let mut inputs = subscribe(&node, &inbox, &lost, &settings, &has_label_source)?;
    let mut network = None;
    if let Some(ready) = ready {
        let tell = segmenter::hand_over(&inbox, &lost, Event::Network);
        let (worker, images) = ready.start(
            &node,
            [name, COLOR],
            settings.compressed_color,
            shutdown,
            tell,
        )?;
        inputs.push(images);
        network = Some(worker);
    }
    losses.watch(&inputs);
    let period = Duration::from_millis(500);
    let looks = inbox.ticks((runtime, &node), period, || Event::Diagnose);
    let set_network = network.as_ref().map(Worker::settings);
    open_params(params, move |params| {
        let settings = Settings::from_params(params).map_err(|error| error.to_string())?;
        if let (Some(set), Some((_, options))) = (&set_network, settings.network) {
            handed_over(set(options))?;
        }
        handed_over(inbox.send(Event::Settings(Box::new(settings.cloud)), 0))
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
    has_label_source: &Arc<AtomicBool>,
) -> Result<Vec<Subscription>, NodeError> {
    let bytes = |image: &Arc<Image>| size_of::<Image>() + image.data.len();
    let packed = |image: &Arc<CompressedImage>| size_of::<CompressedImage>() + image.data.len();
    let images = |stream| {
        let event = move |image| Event::Image(stream, image, Instant::now());
        inbox.counting(lost, event, bytes)
    };
    let topic = "depth_registered/image_rect";
    let mut inputs = vec![if settings.compressed_depth {
        let event = |image| Event::CompressedDepth(image, Instant::now());
        let depth = inbox.counting(lost, event, packed);
        let topic = format!("{topic}/compressedDepth");
        node.subscribe(&topic, Qos::SENSOR, SubscriptionExecutor::Dedicated, depth)?
    } else {
        node.subscribe(
            topic,
            Qos::SENSOR,
            SubscriptionExecutor::Dedicated,
            images(Stream::Depth),
        )?
    }];
    if settings.network.is_none() {
        let labels = node.subscribe(
            LABELS,
            Qos::SENSOR,
            SubscriptionExecutor::Dedicated,
            images(Stream::Labels),
        )?;
        let joined = Arc::clone(has_label_source);
        labels.on_publisher_joined(move || joined.store(true, Ordering::Relaxed));
        inputs.push(labels);
        let names = inbox.counting(lost, Event::LabelInfo, |_| 0);
        inputs.push(node.subscribe(
            "labels/label_info",
            Qos::LATCHED,
            SubscriptionExecutor::Shared,
            names,
        )?);
    }
    if settings.cloud.pair.with_confidence {
        let confidence = images(Stream::Confidence);
        inputs.push(node.subscribe(
            "labels/confidence",
            Qos::SENSOR,
            SubscriptionExecutor::Dedicated,
            confidence,
        )?);
    }
    if settings.cloud.pair.with_color {
        inputs.push(if settings.compressed_color {
            let color = inbox.counting(lost, Event::CompressedColor, packed);
            let topic = format!("{COLOR}/compressed");
            node.subscribe(&topic, Qos::SENSOR, SubscriptionExecutor::Dedicated, color)?
        } else {
            node.subscribe(
                COLOR,
                Qos::SENSOR,
                SubscriptionExecutor::Dedicated,
                images(Stream::Color),
            )?
        });
    }
    let camera = inbox.counting(lost, Event::CameraInfo, |_| 0);
    inputs.push(node.subscribe(
        "rgb/camera_info",
        Qos::SENSOR,
        SubscriptionExecutor::Shared,
        camera,
    )?);
    Ok(inputs)
}

/// State of the compute thread.
struct ComputeState {
    machine: SemanticCloud,
    /// True once a publisher of label images was matched.
    has_label_source: Arc<AtomicBool>,
    /// True after the log line about clouds without labels.
    is_unlabelled: bool,
    points: Publisher<PointCloud2>,
    label_info: Publisher<LabelInfo>,
    network: Option<Outputs>,
    diagnostics: Diagnostics,
    /// Messages rejected by the inbox or lost before it.
    lost: Arc<AtomicU64>,
    losses: Losses,
    /// Stamps of depth images with their arrival times.
    arrivals: VecDeque<(i64, Instant)>,
    /// Latency from a depth image to its cloud, seconds.
    last_latency_s: f64,
    warnings: Throttle,
    /// Dropped messages at the last warning.
    warned: u64,
    report_file: String,
}

impl ComputeState {
    fn on(&mut self, event: Event) {
        let outputs = match event {
            Event::Image(stream, image, at) => {
                if stream == Stream::Depth {
                    self.arrived(image.header.stamp.to_ns(), at);
                }
                self.machine.on_image(stream, image)
            }
            Event::CompressedDepth(image, at) => {
                self.arrived(image.header.stamp.to_ns(), at);
                self.machine.on_compressed_depth(&image)
            }
            Event::CompressedColor(image) => self.machine.on_compressed_color(&image),
            Event::Network(NetworkEvent::Begun(stamp_ns)) => self.machine.on_begun(stamp_ns),
            Event::Network(NetworkEvent::Labelled(labels)) => {
                if let Some(network) = &self.network {
                    network.publish(&labels);
                }
                self.machine.on_labelled(labels)
            }
            Event::Network(NetworkEvent::Names) => {
                self.publish_names();
                return;
            }
            Event::CameraInfo(info) => self.machine.on_camera_info(info),
            Event::LabelInfo(info) => self.machine.on_label_info(info),
            Event::Settings(options) => self.machine.set_options(*options),
            Event::Diagnose => {
                self.diagnose();
                return;
            }
            Event::Finish => {
                let outputs = self.machine.finish();
                self.publish(outputs);
                self.finish();
                return;
            }
        };
        self.publish(outputs);
    }

    fn arrived(&mut self, stamp_ns: i64, at: Instant) {
        let has_label_source = self.has_label_source.load(Ordering::Relaxed);
        self.machine.set_label_source(has_label_source);
        if self.machine.is_unlabelled() && !self.is_unlabelled {
            self.is_unlabelled = true;
            log::info!(
                "clouds have no labels: nobody publishes {LABELS}, or `labels` is none; `labels: image` waits for it"
            );
        }
        self.arrivals.push_back((stamp_ns, at));
        if self.arrivals.len() > MAX_ARRIVALS {
            self.arrivals.pop_front();
        }
    }

    /// Publishes the class names of the built-in network.
    fn publish_names(&mut self) {
        let info = self.network.as_ref().and_then(Outputs::publish_names);
        if let Some(info) = info {
            let outputs = self.machine.on_label_info(info);
            self.publish(outputs);
        }
    }

    fn publish(&mut self, outputs: Vec<CloudOutput>) {
        for output in outputs {
            let published = match output {
                CloudOutput::Points(points) => {
                    let stamp_ns = points.header.stamp.to_ns();
                    let published = self.points.publish(Arc::new(points));
                    let mut arrivals = self.arrivals.iter();
                    if let Some((_, at)) = arrivals.find(|(stamp, _)| *stamp == stamp_ns) {
                        self.last_latency_s = at.elapsed().as_secs_f64();
                    }
                    published
                }
                CloudOutput::LabelInfo(info) => self.label_info.publish(Arc::new(info)),
            };
            if let Err(error) = published {
                log::debug!("not published: {error}");
            }
        }
    }

    fn report(&self) -> CloudReport {
        CloudReport {
            counts: self.machine.counts().clone(),
            images_lost: self.lost.load(Ordering::Relaxed) + self.losses.lost(),
            undecodable: self.losses.undecodable(),
            clouds_not_published: self.points.dropped(),
            network: self.network.as_ref().map(|network| network.view.counts()),
        }
    }

    fn diagnose(&mut self) {
        let report = CloudReport {
            network: None,
            ..self.report()
        };
        let counts = &report.counts;
        let dropped: u64 = counts.dropped.values().sum();
        let problem = self.machine.problem().map(str::to_owned);
        let message = match (self.machine.has_camera(), dropped) {
            (false, _) => "no valid camera_info yet".to_owned(),
            (true, 0) if counts.clouds_out == 0 => "no cloud yet".to_owned(),
            (true, 0) => "making clouds".to_owned(),
            (true, _) => {
                let reasons: Vec<_> = counts
                    .dropped
                    .iter()
                    .map(|(r, n)| format!("{n} {r}"))
                    .collect();
                format!("dropped: {}", reasons.join(", "))
            }
        };
        let is_good = self.machine.has_camera() && counts.clouds_out > 0 && dropped == 0;
        let level = if is_good { Level::Ok } else { Level::Warn };
        if let Some(problem) = problem.as_ref().filter(|_| dropped > self.warned)
            && self.warnings.check().is_some()
        {
            self.warned = dropped;
            log::warn!("{message}; last rejection: {problem}");
        }
        let mut values = report::key_values(&report);
        values.push(("images_waiting".into(), self.machine.waiting().to_string()));
        values.push(("last_refused".into(), problem.unwrap_or_default()));
        values.push((
            "last_latency_s".into(),
            format!("{:.4}", self.last_latency_s),
        ));
        self.diagnostics.set("clouds", level, message, values);
        if let Some(network) = &self.network {
            network.view.diagnose(&self.diagnostics);
        }
    }

    fn finish(&mut self) {
        self.points.flush(LAST_FLUSH);
        let report = self.report();
        let counts = &report.counts;
        let (depth_in, clouds_out, dropped) = (counts.depth_in, counts.clouds_out, &counts.dropped);
        log::info!("{depth_in} depth images in, {clouds_out} clouds out, dropped: {dropped:?}");
        if let Err(error) = report::write(&self.report_file, &report, &self.diagnostics) {
            log::error!("{error}");
        }
    }
}
