//! Subscriptions: their handles, counters and messages.

mod intake;
mod sample;
mod source;

pub(crate) use intake::Intake;
pub(crate) use source::Source;

use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

use lattice_msgs::{RosMessage, cdr};
use smol::Task;
use smol::channel::{Sender, bounded};

use crate::error::RuntimeError;
use crate::shutdown::Shutdown;
use crate::sync::lock;
use crate::task_thread::run_catching_panics;
pub(crate) use sample::{Sample, Stats};

/// Thread that executes the handler of a subscription.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SubscriptionExecutor {
    /// The io thread, shared by all: for poses, transforms, clocks.
    Shared,
    /// A thread of its own: for clouds, images.
    Dedicated,
}

/// A subscription; dropping it ends it.
#[must_use = "dropping a subscription ends it"]
pub struct Subscription {
    pub(crate) intake: Arc<Intake>,
    pub(crate) _running: Running,
}

pub(crate) enum Running {
    /// Ends when dropped.
    OnIoThread { _task: Task<()> },
    /// Ends when the sender is dropped.
    OnOwnThread { _stop: Sender<()> },
}

impl Subscription {
    fn stats(&self) -> &Stats {
        &self.intake.stats
    }

    /// Resolved topic.
    pub fn topic(&self) -> &str {
        self.stats().peers.topic()
    }

    /// Matched publishers in all processes.
    pub fn publisher_count(&self) -> usize {
        self.stats().peers.count()
    }

    /// Messages passed to the handler.
    pub fn received(&self) -> u64 {
        self.stats().received.load(Relaxed)
    }

    /// Calls `callback` at every match with a publisher, and now if one is matched already.
    ///
    /// It runs on a thread of the runtime and must return at once.
    pub fn on_publisher_joined(&self, callback: impl FnMut() + Send + 'static) {
        self.stats().peers.on_joined(Box::new(callback));
    }

    /// Messages that were sent and not handled: lost on the network, or overrun.
    pub fn lost(&self) -> u64 {
        self.stats().lost()
    }

    /// Messages lost on the network, as part of [`Subscription::lost`].
    pub fn lost_on_network(&self) -> u64 {
        self.stats().losses.on_network.load(Relaxed)
    }

    /// Messages overwritten by newer ones before they were handled, as part of [`Subscription::lost`].
    pub fn overrun(&self) -> u64 {
        self.stats().losses.overrun.load(Relaxed)
    }

    /// Samples rejected because they are too long or not of this type.
    pub fn undecodable(&self) -> u64 {
        self.stats().undecodable.load(Relaxed)
    }
}

/// Sum of the losses of some subscriptions; clones share it, and it outlives the subscriptions.
#[derive(Clone, Default)]
pub struct Losses(Arc<Mutex<Vec<Arc<Stats>>>>);

impl Losses {
    /// Adds the losses of subscriptions.
    pub fn watch<'a>(&self, subscriptions: impl IntoIterator<Item = &'a Subscription>) {
        let stats = |of: &Subscription| Arc::clone(&of.intake.stats);
        lock(&self.0).extend(subscriptions.into_iter().map(stats));
    }

    /// Sum of [`Subscription::lost`].
    pub fn lost(&self) -> u64 {
        self.sum(Stats::lost)
    }

    /// Sum of [`Subscription::lost_on_network`].
    pub fn on_network(&self) -> u64 {
        self.sum(|stats| stats.losses.on_network.load(Relaxed))
    }

    /// Sum of [`Subscription::overrun`].
    pub fn overrun(&self) -> u64 {
        self.sum(|stats| stats.losses.overrun.load(Relaxed))
    }

    /// Sum of [`Subscription::undecodable`].
    pub fn undecodable(&self) -> u64 {
        self.sum(|stats| stats.undecodable.load(Relaxed))
    }

    fn sum(&self, of: impl Fn(&Stats) -> u64) -> u64 {
        lock(&self.0).iter().map(|stats| of(stats)).sum()
    }
}

/// A message to be decoded on another thread than the receiving one.
pub struct Undecoded<M> {
    content: Content<M>,
    stats: Arc<Stats>,
}

enum Content<M> {
    Shared(Arc<M>),
    Cdr(Vec<u8>),
}

impl<M: RosMessage> Undecoded<M> {
    pub(crate) fn new(sample: Sample<'_, M>, stats: &Arc<Stats>) -> Self {
        Self {
            content: match sample {
                Sample::Shared(message) => Content::Shared(message),
                Sample::Cdr(bytes) => Content::Cdr(std::mem::take(bytes)),
            },
            stats: Arc::clone(stats),
        }
    }

    /// Length in bytes; `shared` measures a message of this process.
    pub fn bytes(&self, shared: impl FnOnce(&M) -> usize) -> usize {
        match &self.content {
            Content::Shared(message) => shared(message),
            Content::Cdr(bytes) => bytes.len(),
        }
    }

    /// CDR of the message, unchecked: as received, or serialized if it comes from this process.
    pub fn into_cdr(self) -> Result<Vec<u8>, cdr::CdrError> {
        self.stats.received.fetch_add(1, Relaxed);
        match self.content {
            Content::Shared(message) => cdr::to_vec(&*message),
            Content::Cdr(bytes) => Ok(bytes),
        }
    }

    /// Decodes the message. `None`: the bytes are not of the type, which is counted and logged.
    pub fn decode(self) -> Option<Arc<M>> {
        let Self { content, stats } = self;
        match content {
            Content::Shared(message) => stats.decode(Sample::Shared(message)),
            Content::Cdr(mut bytes) => stats.decode(Sample::Cdr(&mut bytes)),
        }
    }
}

/// Runs a subscription on a separate thread until the sender is dropped.
pub(crate) fn spawn_reader(
    shutdown: &Shutdown,
    task: impl Future<Output = ()> + Send + 'static,
) -> Result<(Sender<()>, JoinHandle<()>), RuntimeError> {
    let (stop, stopped) = bounded::<()>(1);
    let shutdown = shutdown.clone();
    let thread = std::thread::Builder::new()
        .name("reader".to_owned())
        .spawn(move || {
            run_catching_panics("reader", &shutdown, || {
                smol::future::block_on(smol::future::or(task, async {
                    // Ends when the sender closes.
                    let _ = stopped.recv().await;
                }));
            });
        })?;
    Ok((stop, thread))
}
