//! Segmenter on a separate thread of another node.

use std::io;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use lattice_msgs::sensor_msgs::{CompressedImage, Image};
use lattice_msgs::vision_msgs::LabelInfo;

use super::counts::SegmenterCounts;
use super::labels::Labelled;
use super::machine::Segmenter;
use super::network::Interrupter;
use super::options::SegmenterOptions;
use crate::camera::LabelSet;
use crate::compute::{Compute, ComputeLimits, Inbox};
use lattice_runtime::Shutdown;

/// Longest inference after the request to end; then it is interrupted.
pub(super) const MAX_LAST_INFERENCE: Duration = Duration::from_millis(500);

/// Received image.
pub(crate) enum Input {
    Plain(Arc<Image>),
    Compressed(Arc<CompressedImage>),
}

/// Slot for the newest image; replaced ones are skipped.
#[derive(Default)]
pub(super) struct Slot {
    image: Mutex<Option<Input>>,
    skipped: AtomicU64,
}

impl Slot {
    /// Stores an image; true if the slot was empty.
    pub fn put(&self, image: Input) -> bool {
        let old = {
            let mut slot = self.image.lock().unwrap_or_else(PoisonError::into_inner);
            slot.replace(image)
        };
        // Freed without the lock.
        self.skipped
            .fetch_add(u64::from(old.is_some()), Ordering::Relaxed);
        old.is_none()
    }

    pub fn take(&self) -> Option<Input> {
        let mut slot = self.image.lock().unwrap_or_else(PoisonError::into_inner);
        slot.take()
    }

    /// Removes an image whose notification failed.
    pub fn take_back(&self) {
        if self.take().is_some() {
            self.skipped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Images skipped since the last call.
    pub fn skipped(&self) -> u64 {
        self.skipped.swap(0, Ordering::Relaxed)
    }
}

/// Event for the network thread.
enum Event {
    /// An image is in the slot.
    Image,
    Settings(Box<SegmenterOptions>),
    Finish,
}

/// Event from the network thread.
pub(crate) enum NetworkEvent {
    /// Inference of an image with this stamp has begun.
    Begun(i64),
    /// An image is labelled; its colours are in the set.
    Labelled(LabelSet),
    /// The names of the classes may have changed.
    Names,
}

impl NetworkEvent {
    /// Bytes for the inbox of the node.
    pub fn bytes(&self) -> usize {
        match self {
            Self::Labelled(labels) => labels.bytes(),
            Self::Begun(_) | Self::Names => 0,
        }
    }
}

/// State shared with other threads.
#[derive(Clone, Debug)]
pub(super) struct WorkerState {
    pub counts: SegmenterCounts,
    pub problem: Option<String>,
    /// Inference time of the last image, seconds.
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

/// Segmenter on a separate thread: labels the newest image and skips replaced ones.
pub(crate) struct Worker {
    compute: Compute<Event>,
    slot: Arc<Slot>,
    interrupt: Interrupter,
}

impl Worker {
    /// Starts the thread, which publishes its state after each image; `tell` receives its events.
    pub(super) fn spawn(
        name: &str,
        segmenter: Segmenter,
        state: Arc<Mutex<WorkerState>>,
        shutdown: Shutdown,
        tell: impl FnMut(NetworkEvent) + Send + 'static,
    ) -> io::Result<Self> {
        let slot = Arc::new(Slot::default());
        let interrupt = segmenter.interrupter();
        let mut job = Job {
            segmenter,
            slot: Arc::clone(&slot),
            state,
            last_s: 0.0,
            tell,
        };
        let limits = ComputeLimits {
            events: 16,
            // Only the newest image waits.
            bytes: usize::MAX,
            threads: 1,
        };
        let name = format!("{name} network");
        let compute = Compute::spawn(&name, limits, shutdown, move |event| job.on(event))?;
        Ok(Self {
            compute,
            slot,
            interrupt,
        })
    }

    /// Handler that stores images and returns at once.
    pub fn image_callback(&self) -> impl FnMut(Input) + Send + 'static {
        let (slot, inbox): (_, Inbox<Event>) = (Arc::clone(&self.slot), self.compute.inbox());
        move |image| {
            if slot.put(image) && !inbox.send(Event::Image, 0) {
                // The next image notifies again.
                slot.take_back();
            }
        }
    }

    /// Function that changes the options of the network; `false`: the inbox is full.
    pub fn settings(&self) -> impl Fn(SegmenterOptions) -> bool + Send + Sync + 'static {
        let inbox = self.compute.inbox();
        move |options| inbox.send(Event::Settings(Box::new(options)), 0)
    }

    /// Labels the waiting image if the network is fast enough, and ends the thread.
    pub fn finish(self) {
        self.compute
            .finish_hurrying(Event::Finish, MAX_LAST_INFERENCE, self.interrupt);
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

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;
    use std::sync::mpsc::{Sender, channel};

    use super::*;
    use crate::segmenter::{Network, Scores, Size};

    /// A network that ends by an interruption only.
    struct Endless {
        began: Sender<()>,
        interrupted: Arc<AtomicBool>,
    }

    impl Network for Endless {
        fn input(&self) -> Size {
            Size {
                width: 1,
                height: 1,
            }
        }

        fn names(&self) -> &[String] {
            &[]
        }

        fn run(&self, _: Vec<f32>) -> Result<Scores, String> {
            self.began.send(()).unwrap();
            while !self.interrupted.load(Ordering::Relaxed) {
                std::thread::yield_now();
            }
            Err("interrupted".to_owned())
        }

        fn interrupter(&self) -> Interrupter {
            let interrupted = Arc::clone(&self.interrupted);
            Box::new(move || interrupted.store(true, Ordering::Relaxed))
        }
    }

    #[test]
    fn a_busy_network_is_interrupted_at_the_end() {
        let (began, begun) = channel();
        let network = Endless {
            began,
            interrupted: Arc::default(),
        };
        let segmenter = Segmenter::new(SegmenterOptions::default(), Box::new(network));
        let state = Arc::new(Mutex::new(WorkerState::new(&segmenter, 0.0)));
        let (shown, shutdown) = (Arc::clone(&state), Shutdown::default());
        let worker = Worker::spawn("test", segmenter, state, shutdown, |_| ()).unwrap();
        let image = Arc::new(Image {
            height: 1,
            width: 1,
            encoding: "rgb8".to_owned(),
            step: 3,
            data: vec![1, 2, 3].into(),
            ..Image::default()
        });
        let mut put = worker.image_callback();
        put(Input::Plain(Arc::clone(&image)));
        begun.recv().unwrap();
        // It waits while the network runs.
        put(Input::Plain(image));
        let begin = Instant::now();
        worker.finish();
        assert!(begin.elapsed() >= MAX_LAST_INFERENCE);
        assert_eq!(
            begun.try_iter().count(),
            1,
            "the waiting image fails at once"
        );
        let counts = shown.lock().unwrap().counts.clone();
        assert_eq!((counts.images_in, counts.labels_out), (2, 0));
        assert_eq!(
            counts.dropped.into_iter().collect::<Vec<_>>(),
            [("skipped".to_owned(), 2)]
        );
    }
}
