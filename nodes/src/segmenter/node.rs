//! ROS node around [`Segmenter`].

use std::sync::Arc;
use std::time::{Duration, Instant};

use lattice_msgs::sensor_msgs::Image;
use lattice_msgs::vision_msgs::LabelInfo;

use super::inside::{self, status_of};
use super::parameters::Settings;
use super::worker::{Input, MAX_LAST_INFERENCE, Slot};
use super::{Segmenter, SegmenterOptions, SegmenterReport};
use crate::compute::Compute;
use crate::report;
use crate::start::{Finish, LAST_FLUSH, NodeError, handed_over, open_params};
use lattice_runtime::logging::Throttle;
use lattice_runtime::qos::Qos;
use lattice_runtime::{Diagnostics, Losses, Publisher, Runtime};

/// Event for the compute thread.
enum Event {
    /// An image is in the slot.
    Image,
    Diagnose,
    Settings(Box<SegmenterOptions>),
    Finish,
}

/// Starts the node.
pub fn start(runtime: &Runtime, name: &str) -> Result<Finish, NodeError> {
    let node = runtime.node(name)?;
    let params = node.params();
    let settings = Settings::from_params(params)?;
    let Some(network) = &settings.network else {
        return Err(params.invalid("model", "expected an ONNX file").into());
    };
    let network = network.read(params, &runtime.shutdown_handle())?;
    let (slot, losses) = (Arc::new(Slot::default()), Losses::default());
    let compute_state = ComputeState {
        machine: Segmenter::new(settings.segmenter, network),
        slot: Arc::clone(&slot),
        labels: node.publisher("labels/image", Qos::SCANS)?,
        confidence: node.publisher("labels/confidence", Qos::SCANS)?,
        label_info: node.publisher("labels/label_info", Qos::LATCHED)?,
        diagnostics: node.diagnostics(),
        losses: losses.clone(),
        last_s: 0.0,
        warnings: Throttle::new(Duration::from_secs(5)),
        warned: 0,
        report_file: settings.report_file,
    };
    compute_state.publish_names();
    let interrupt = compute_state.machine.interrupter();
    let mut compute_state = compute_state;
    let shutdown = runtime.shutdown_handle();
    let compute = Compute::spawn(name, settings.limits, shutdown, move |event| {
        compute_state.on(event)
    })?;
    let inbox = compute.inbox();
    let wake = inbox.clone();
    let on_image = move |image: Input| {
        if slot.put(image) && !wake.send(Event::Image, 0) {
            // The next image notifies again.
            slot.take_back();
        }
    };
    let images = inside::subscribe(&node, "rgb/image_rect_color", settings.compressed, on_image)?;
    losses.watch(std::slice::from_ref(&images));
    let period = Duration::from_millis(500);
    let looks = inbox.ticks((runtime, &node), period, || Event::Diagnose);
    open_params(params, move |params| {
        let settings = Settings::from_params(params).map_err(|error| error.to_string())?;
        handed_over(inbox.send(Event::Settings(Box::new(settings.segmenter)), 0))
    });
    Ok(Box::new(move || {
        drop((images, looks));
        compute.finish_hurrying(Event::Finish, MAX_LAST_INFERENCE, interrupt);
        Box::new(())
    }))
}

/// State of the compute thread.
struct ComputeState {
    machine: Segmenter,
    slot: Arc<Slot>,
    labels: Publisher<Image>,
    confidence: Publisher<Image>,
    label_info: Publisher<LabelInfo>,
    diagnostics: Diagnostics,
    losses: Losses,
    /// Inference time of the last image, seconds.
    last_s: f64,
    warnings: Throttle,
    /// Rejected images at the last warning.
    warned: u64,
    report_file: String,
}

impl ComputeState {
    fn on(&mut self, event: Event) {
        match event {
            Event::Image => self.label(),
            Event::Settings(options) => {
                self.machine.set_options(*options);
                self.publish_names();
            }
            Event::Diagnose => self.diagnose(),
            Event::Finish => {
                self.label();
                self.finish();
            }
        }
    }

    fn label(&mut self) {
        let Some(image) = self.slot.take() else {
            return;
        };
        self.machine.skip(self.slot.skipped());
        let began = Instant::now();
        let labelled = match image {
            Input::Plain(image) => self.machine.on_image(&image),
            Input::Compressed(image) => self.machine.on_compressed(&image),
        };
        let Some(labelled) = labelled else {
            return;
        };
        self.last_s = began.elapsed().as_secs_f64();
        let confidence = labelled
            .confidence
            .map(|c| self.confidence.publish(Arc::new(c)));
        let labels = self.labels.publish(Arc::new(labelled.labels));
        if let Err(error) = labels.and(confidence.unwrap_or(Ok(()))) {
            log::debug!("not published: {error}");
        }
    }

    fn publish_names(&self) {
        if let Some(info) = self.machine.label_info()
            && let Err(error) = self.label_info.publish(Arc::new(info))
        {
            log::debug!("not published: {error}");
        }
    }

    fn report(&self) -> SegmenterReport {
        SegmenterReport {
            counts: self.machine.counts().clone(),
            images_lost: self.losses.lost(),
            undecodable: self.losses.undecodable(),
        }
    }

    fn diagnose(&mut self) {
        let report = self.report();
        let (level, message) = status_of(&report.counts);
        let dropped = report.counts.dropped.iter();
        let refused = dropped.filter(|(reason, _)| *reason != "skipped");
        let refused: u64 = refused.map(|(_, n)| n).sum();
        let problem = self.machine.problem().map(str::to_owned);
        if let Some(problem) = problem.as_ref().filter(|_| refused > self.warned)
            && self.warnings.check().is_some()
        {
            self.warned = refused;
            log::warn!("{message}; last rejection: {problem}");
        }
        let mut values = report::key_values(&report);
        values.push(("last_image_s".into(), format!("{:.4}", self.last_s)));
        values.push(("last_refused".into(), problem.unwrap_or_default()));
        self.diagnostics.set("labels", level, message, values);
    }

    fn finish(&mut self) {
        self.labels.flush(LAST_FLUSH);
        let report = self.report();
        let counts = &report.counts;
        let (images_in, labels_out, dropped) =
            (counts.images_in, counts.labels_out, &counts.dropped);
        log::info!("{images_in} images in, {labels_out} labelled, dropped: {dropped:?}");
        if let Err(error) = report::write(&self.report_file, &report, &self.diagnostics) {
            log::error!("{error}");
        }
    }
}
