//! A segmenter on a thread of its own, inside of another node.

use std::io;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use lattice_msgs::sensor_msgs::{CompressedImage, Image};
use lattice_msgs::vision_msgs::LabelInfo;

use super::{Labelled, Segmenter, SegmenterCounts, SegmenterOptions};
use crate::camera::LabelSet;
use crate::compute::{Compute, ComputeLimits, Inbox};
use lattice_runtime::Shutdown;

/// Image as it came.
pub(crate) enum Input {
    Plain(Arc<Image>),
    Compressed(Arc<CompressedImage>),
}

/// Place of the newest image; those that it replaces are skipped.
#[derive(Default)]
pub(super) struct Slot {
    image: Mutex<Option<Input>>,
    skipped: AtomicU64,
}

impl Slot {
    /// Puts an image there; true if the place was empty.
    pub fn put(&self, image: Input) -> bool {
        let old = {
            let mut slot = self.image.lock().unwrap_or_else(PoisonError::into_inner);
            slot.replace(image)
        };
        // It is freed without the lock.
        self.skipped
            .fetch_add(u64::from(old.is_some()), Ordering::Relaxed);
        old.is_none()
    }

    pub fn take(&self) -> Option<Input> {
        let mut slot = self.image.lock().unwrap_or_else(PoisonError::into_inner);
        slot.take()
    }

    /// Takes an image back that nobody could be told of.
    pub fn take_back(&self) {
        if self.take().is_some() {
            self.skipped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Images skipped since this was asked last.
    pub fn skipped(&self) -> u64 {
        self.skipped.swap(0, Ordering::Relaxed)
    }
}

/// Event for the thread of the network.
enum Event {
    /// There is an image in the slot.
    Image,
    Settings(Box<SegmenterOptions>),
    Finish,
}

/// Event that the thread of a network tells of.
pub(crate) enum NetworkEvent {
    /// The network begins with an image of this stamp.
    Begun(i64),
    /// An image is labelled; its colours are in the set.
    Labelled(LabelSet),
    /// The names of the classes may have changed.
    Names,
}

impl NetworkEvent {
    /// Bytes that wait in the inbox of the node.
    pub fn bytes(&self) -> usize {
        match self {
            Self::Labelled(labels) => labels.bytes(),
            Self::Begun(_) | Self::Names => 0,
        }
    }
}

/// State that other threads look at.
#[derive(Clone, Debug)]
pub(super) struct WorkerState {
    pub counts: SegmenterCounts,
    pub problem: Option<String>,
    /// Time of the last image in the network, seconds.
    pub last_s: f64,
    pub label_info: Option<LabelInfo>,
}

impl WorkerState {
    pub fn new(segmenter: &Segmenter, last_s: f64) -> Self {
        Self {
            counts: segmenter.counts().clone(),
            problem: segmenter.problem().map(str::to_owned),
            last_s,
            label_info: segmenter.label_info(),
        }
    }
}

/// A segmenter on a thread of its own: it labels the newest image, and skips those that newer ones replace.
pub(crate) struct Worker {
    compute: Compute<Event>,
    slot: Arc<Slot>,
}

impl Worker {
    /// Starts the thread, which shows its state after each image; `tell` is called on it.
    pub(super) fn spawn(
        name: &str,
        segmenter: Segmenter,
        state: Arc<Mutex<WorkerState>>,
        shutdown: Shutdown,
        tell: impl FnMut(NetworkEvent) + Send + 'static,
    ) -> io::Result<Self> {
        let slot = Arc::new(Slot::default());
        let mut job = Job {
            segmenter,
            slot: Arc::clone(&slot),
            state,
            last_s: 0.0,
            tell,
        };
        let limits = ComputeLimits {
            events: 16,
            // The image that waits is the newest; none other does.
            bytes: usize::MAX,
            threads: 1,
        };
        let name = format!("{name} network");
        let compute = Compute::spawn(&name, limits, shutdown, move |event| job.on(event))?;
        Ok(Self { compute, slot })
    }

    /// A handler that hands images over and returns at once.
    pub fn image_callback(&self) -> impl FnMut(Input) + Send + 'static {
        let (slot, inbox): (_, Inbox<Event>) = (Arc::clone(&self.slot), self.compute.inbox());
        move |image| {
            if slot.put(image) && !inbox.send(Event::Image, 0) {
                // The next one finds the place empty.
                slot.take_back();
            }
        }
    }

    /// A function that makes the network go on with other options; `false`: there is no room now.
    pub fn settings(&self) -> impl Fn(SegmenterOptions) -> bool + Send + Sync + 'static {
        let inbox = self.compute.inbox();
        move |options| inbox.send(Event::Settings(Box::new(options)), 0)
    }

    /// Labels the image that waits, and ends the thread.
    pub fn finish(self) {
        self.compute.finish_with(Event::Finish);
    }
}

/// State of the thread.
struct Job<T> {
    segmenter: Segmenter,
    slot: Arc<Slot>,
    state: Arc<Mutex<WorkerState>>,
    last_s: f64,
    tell: T,
}

impl<T: FnMut(NetworkEvent)> Job<T> {
    fn on(&mut self, event: Event) {
        match event {
            Event::Settings(options) => {
                self.segmenter.set_options(*options);
                self.show();
                (self.tell)(NetworkEvent::Names);
            }
            Event::Image | Event::Finish => {
                if let Some(set) = self.label() {
                    (self.tell)(NetworkEvent::Labelled(set));
                }
                self.show();
            }
        }
    }

    fn label(&mut self) -> Option<LabelSet> {
        let input = self.slot.take()?;
        self.segmenter.skip(self.slot.skipped());
        let began = Instant::now();
        let image = match input {
            Input::Plain(image) => image,
            Input::Compressed(packed) => self.segmenter.unpack(&packed)?,
        };
        if self.segmenter.can_read(&image) {
            (self.tell)(NetworkEvent::Begun(image.header.stamp.to_ns()));
        }
        let Labelled {
            labels,
            confidence,
            soft,
        } = self.segmenter.on_image(&image)?;
        self.last_s = began.elapsed().as_secs_f64();
        Some(LabelSet {
            labels: Arc::new(labels),
            confidence: confidence.map(Arc::new),
            colors: Some(image),
            soft: soft.map(Arc::new),
        })
    }

    fn show(&self) {
        let state = WorkerState::new(&self.segmenter, self.last_s);
        *self.state.lock().unwrap_or_else(PoisonError::into_inner) = state;
    }
}
