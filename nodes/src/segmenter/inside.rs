//! Built-in network of another node: its thread, subscriptions and status.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use lattice_msgs::vision_msgs::LabelInfo;

use super::counts::SegmenterCounts;
use super::machine::Segmenter;
use super::options::SegmenterOptions;
use super::parameters::NetworkSettings;
use super::worker::{Input, NetworkEvent, Worker, WorkerState};

use crate::compute::Inbox;
use crate::report;
use crate::start::NodeError;
use lattice_runtime::params::{ParamError, Params};
use lattice_runtime::qos::Qos;
use lattice_runtime::{Diagnostics, Level, Node, Shutdown, Subscription, SubscriptionExecutor};

/// A loaded network.
pub(crate) struct LoadedNetwork {
    segmenter: Segmenter,
    view: NetworkView,
}

impl LoadedNetwork {
    /// Loads the model; errors name the invalid parameter.
    pub fn new(
        params: &Params,
        settings: &NetworkSettings,
        options: SegmenterOptions,
        shutdown: &Shutdown,
    ) -> Result<Self, ParamError> {
        let segmenter = Segmenter::new(options, settings.read(params, shutdown)?);
        let view = WorkerState::new(&segmenter, 0.0);
        let view = NetworkView(Arc::new(Mutex::new(view)));
        Ok(Self { segmenter, view })
    }

    /// View of the network's state for the node.
    pub fn view(&self) -> NetworkView {
        self.view.clone()
    }

    /// Starts its thread on the images of a topic; `tell` receives its events.
    pub fn start(
        self,
        node: &Node,
        [name, topic]: [&str; 2],
        is_compressed: bool,
        shutdown: Shutdown,
        tell: impl FnMut(NetworkEvent) + Send + 'static,
    ) -> Result<(Worker, Subscription), NodeError> {
        let worker = Worker::spawn(name, self.segmenter, self.view.0, shutdown, tell)?;
        let images = subscribe(node, topic, is_compressed, worker.image_callback())?;
        Ok((worker, images))
    }
}

/// Subscribes to the images of a topic, plain or JPEG-compressed.
pub(super) fn subscribe(
    node: &Node,
    topic: &str,
    is_compressed: bool,
    mut enter: impl FnMut(Input) + Send + 'static,
) -> Result<Subscription, NodeError> {
    Ok(if is_compressed {
        let topic = format!("{topic}/compressed");
        let enter = move |image| enter(Input::Compressed(image));
        node.subscribe(&topic, Qos::SENSOR, SubscriptionExecutor::Dedicated, enter)?
    } else {
        let enter = move |image| enter(Input::Plain(image));
        node.subscribe(topic, Qos::SENSOR, SubscriptionExecutor::Dedicated, enter)?
    })
}

/// Passes network events to the thread of its node; rejected labels are counted as `lost`.
pub(crate) fn hand_over<E: Send + 'static>(
    inbox: &Inbox<E>,
    lost: &Arc<AtomicU64>,
    event: fn(NetworkEvent) -> E,
) -> impl FnMut(NetworkEvent) + Send + use<E> {
    let (inbox, lost) = (inbox.clone(), Arc::clone(lost));
    move |news| {
        let (bytes, is_image) = (news.bytes(), matches!(news, NetworkEvent::Labelled(_)));
        let sent = inbox.send(event(news), bytes);
        lost.fetch_add(u64::from(is_image && !sent), Ordering::Relaxed);
    }
}

/// State of a network after its last image.
#[derive(Clone)]
pub(crate) struct NetworkView(Arc<Mutex<WorkerState>>);

impl NetworkView {
    fn state(&self) -> WorkerState {
        let state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        state.clone()
    }

    /// Image counters.
    pub fn counts(&self) -> SegmenterCounts {
        self.state().counts
    }

    /// Names of the classes.
    pub fn label_info(&self) -> Option<LabelInfo> {
        self.state().label_info
    }

    /// Sets the status of the network in the diagnostics.
    pub fn diagnose(&self, diagnostics: &Diagnostics) {
        let state = self.state();
        let (level, message) = status_of(&state.counts);
        let mut values = report::key_values(&state.counts);
        values.push(("last_image_s".into(), format!("{:.4}", state.last_s)));
        values.push(("last_refused".into(), state.problem.unwrap_or_default()));
        diagnostics.set("network", level, message, values);
    }
}

/// Status level and text of the labelling.
pub(super) fn status_of(counts: &SegmenterCounts) -> (Level, String) {
    // Skipping images faster than the network is normal.
    let refused = counts.dropped.iter();
    let refused = refused.filter(|(reason, _)| *reason != "skipped");
    let reasons: Vec<String> = refused.map(|(r, n)| format!("{n} {r}")).collect();
    match (counts.labels_out, reasons.is_empty()) {
        (0, true) => (Level::Warn, "no image yet".to_owned()),
        (_, true) => (Level::Ok, "labelling images".to_owned()),
        _ => (Level::Warn, format!("dropped: {}", reasons.join(", "))),
    }
}
