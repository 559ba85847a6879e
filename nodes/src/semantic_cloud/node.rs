//! The machine as a ROS node: a thin shell around [`SemanticCloud`].

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use lattice_msgs::sensor_msgs::{CameraInfo, CompressedImage, Image, PointCloud2};
use lattice_msgs::vision_msgs::LabelInfo;

use super::parameters::Settings;
use super::{CloudOptions, CloudOutput, CloudReport, SemanticCloud, Stream};
use crate::compute::Compute;
use crate::report;
use crate::start::{Finish, NodeError, handed_over, open_params};
use lattice_runtime::logging::Throttle;
use lattice_runtime::qos::Qos;
use lattice_runtime::{Diagnostics, Level, Load, Losses, Publisher, Runtime};

/// Event for the compute thread.
enum Event {
    Image(Stream, Arc<Image>),
    CompressedDepth(Arc<CompressedImage>),
    CameraInfo(Arc<CameraInfo>),
    LabelInfo(Arc<LabelInfo>),
    Diagnose,
    Settings(Box<CloudOptions>),
    Finish,
}

/// Starts the node.
pub fn start(runtime: &Runtime, name: &str) -> Result<Finish, NodeError> {
    let node = runtime.node(name)?;
    let params = node.params();
    let settings = Settings::from_params(params)?;
    let with_confidence = settings.cloud.pair.with_confidence;
    let (lost, losses) = (Arc::new(AtomicU64::new(0)), Losses::default());
    let mut shell = Shell {
        machine: SemanticCloud::new(settings.cloud),
        points: node.publisher("points", Qos::SCANS)?,
        label_info: node.publisher("label_info", Qos::LATCHED)?,
        diagnostics: node.diagnostics(),
        lost: Arc::clone(&lost),
        losses: losses.clone(),
        warnings: Throttle::new(Duration::from_secs(5)),
        warned: 0,
        report_file: settings.report_file,
    };
    let shutdown = runtime.shutdown_handle();
    let compute = Compute::spawn(name, settings.limits, shutdown, move |event| {
        shell.on(event)
    })?;
    let inbox = compute.inbox();
    let bytes = |image: &Arc<Image>| size_of::<Image>() + image.data.len();
    let topic = "depth_registered/image_rect";
    let depth = if settings.compressed_depth {
        let size = |image: &Arc<CompressedImage>| size_of::<CompressedImage>() + image.data.len();
        let depth = inbox.counting(&lost, Event::CompressedDepth, size);
        let topic = format!("{topic}/compressedDepth");
        node.subscribe(&topic, Qos::SENSOR, Load::Large, depth)?
    } else {
        let depth = inbox.counting(&lost, |image| Event::Image(Stream::Depth, image), bytes);
        node.subscribe(topic, Qos::SENSOR, Load::Large, depth)?
    };
    let labels = inbox.counting(&lost, |image| Event::Image(Stream::Labels, image), bytes);
    let labels = node.subscribe("labels/image", Qos::SENSOR, Load::Large, labels)?;
    let mut inputs = vec![depth, labels];
    if with_confidence {
        let confidence = inbox.counting(&lost, |m| Event::Image(Stream::Confidence, m), bytes);
        inputs.push(node.subscribe("labels/confidence", Qos::SENSOR, Load::Large, confidence)?);
    }
    let camera = inbox.counting(&lost, Event::CameraInfo, |_| 0);
    inputs.push(node.subscribe("rgb/camera_info", Qos::SENSOR, Load::Small, camera)?);
    let names = inbox.counting(&lost, Event::LabelInfo, |_| 0);
    inputs.push(node.subscribe("labels/label_info", Qos::LATCHED, Load::Small, names)?);
    losses.watch(&inputs);
    let looks = inbox.clone();
    let looks = runtime.timer(Duration::from_millis(500), move || {
        let _ = looks.send(Event::Diagnose, 0);
    });
    open_params(params, move |params| {
        let settings = Settings::from_params(params).map_err(|error| error.to_string())?;
        handed_over(inbox.send(Event::Settings(Box::new(settings.cloud)), 0))
    });
    Ok(Box::new(move || {
        drop((inputs, looks));
        compute.finish_with(Event::Finish);
        Box::new(())
    }))
}

/// State of the compute thread.
struct Shell {
    machine: SemanticCloud,
    points: Publisher<PointCloud2>,
    label_info: Publisher<LabelInfo>,
    diagnostics: Diagnostics,
    /// Messages that found the inbox full, and those lost before it.
    lost: Arc<AtomicU64>,
    losses: Losses,
    warnings: Throttle,
    /// Messages dropped when there was a warning last.
    warned: u64,
    report_file: String,
}

impl Shell {
    fn on(&mut self, event: Event) {
        let outputs = match event {
            Event::Image(stream, image) => self.machine.on_image(stream, image),
            Event::CompressedDepth(image) => self.machine.on_compressed_depth(&image),
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

    fn publish(&self, outputs: Vec<CloudOutput>) {
        for output in outputs {
            let published = match output {
                CloudOutput::Points(points) => self.points.publish(Arc::new(points)),
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
        }
    }

    fn diagnose(&mut self) {
        let report = self.report();
        let counts = &report.counts;
        let dropped: u64 = counts.dropped.values().sum();
        let problem = self.machine.problem().map(str::to_owned);
        let message = match (self.machine.has_camera(), dropped) {
            (false, _) => "no camera_info yet that can be used".to_owned(),
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
            log::warn!("{message}; last refused: {problem}");
        }
        let mut values = report::key_values(&report);
        values.push(("images_waiting".into(), self.machine.waiting().to_string()));
        values.push(("last_refused".into(), problem.unwrap_or_default()));
        self.diagnostics.set("clouds", level, message, values);
    }

    fn finish(&mut self) {
        self.points.flush(Duration::from_secs(2));
        let report = self.report();
        let counts = &report.counts;
        let (depth_in, clouds_out, dropped) = (counts.depth_in, counts.clouds_out, &counts.dropped);
        log::info!("{depth_in} depth images in, {clouds_out} clouds out, dropped: {dropped:?}");
        if let Err(error) = report::write(&self.report_file, &report, &self.diagnostics) {
            log::error!("{error}");
        }
    }
}
