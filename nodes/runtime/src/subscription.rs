//! Subscriptions: from DDS and from this process to one handler.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::thread::JoinHandle;
use std::time::Duration;

use lattice_msgs::{RosMessage, cdr};
use rustdds::GUID;
use smol::Task;
use smol::channel::{Receiver, Sender, bounded};
use smol::future::{or, pending};

use super::dds::reader::{DdsReader, SampleOrigin};
use super::error::RuntimeError;
use super::local_bus::{AnyMessage, Membership};
use super::logging::Throttle;
use super::peers::Peers;
use super::reader_port::{Command, ReaderPort};
use super::shutdown::Shutdown;
use super::worker::guarded;

/// After so many messages in a row, a task lets the others of its thread have a turn.
const MESSAGES_PER_TURN: u32 = 16;

/// Between two warnings of undecodable samples.
const WARNING_PERIOD: Duration = Duration::from_secs(5);

/// Writers whose last sample is remembered.
const MAX_WRITERS: usize = 1024;

/// Size of the messages of a subscription, which decides the thread that takes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Load {
    /// Poses, transforms, clocks: taken on the io thread.
    Small,
    /// Clouds, images, maps: taken on a thread of their own.
    Large,
}

/// A subscription; dropping it ends it.
#[must_use = "dropping a subscription ends it"]
pub struct Subscription {
    port: Arc<ReaderPort>,
    _running: Running,
}

pub(crate) enum Running {
    /// Ends when dropped.
    OnIoThread { _task: Task<()> },
    /// Ends when the sender is dropped.
    OnOwnThread { _stop: Sender<()> },
}

/// Counters of a subscription.
pub(crate) struct Stats {
    peers: Arc<Peers>,
    received: AtomicU64,
    undecodable: AtomicU64,
    lost: Arc<AtomicU64>,
    warning: Throttle,
}

impl Subscription {
    pub(crate) fn new(port: Arc<ReaderPort>, running: Running) -> Self {
        Self {
            port,
            _running: running,
        }
    }

    fn stats(&self) -> &Stats {
        &self.port.stats
    }

    /// Resolved topic.
    pub fn topic(&self) -> &str {
        self.stats().peers.topic()
    }

    /// Matched publishers, here and in other processes.
    pub fn publisher_count(&self) -> usize {
        self.stats().peers.count()
    }

    /// Messages given to the handler.
    pub fn received(&self) -> u64 {
        self.stats().received.load(Relaxed)
    }

    /// Calls `callback` for every publisher that joins, and now if there is one already.
    ///
    /// It runs on a thread of the runtime and must return at once.
    pub fn on_publisher_joined(&self, callback: impl FnMut() + Send + 'static) {
        self.stats().peers.on_joined(Box::new(callback));
    }

    /// Messages that were sent and did not get here: gaps in the numbers of a publisher.
    pub fn lost(&self) -> u64 {
        self.stats().lost()
    }

    /// Samples that were no message of this type, or too long, and were left out.
    pub fn undecodable(&self) -> u64 {
        self.stats().undecodable.load(Relaxed)
    }
}

impl Stats {
    pub(crate) fn new(peers: Arc<Peers>) -> Self {
        Self {
            peers,
            received: AtomicU64::new(0),
            undecodable: AtomicU64::new(0),
            lost: Arc::default(),
            warning: Throttle::new(WARNING_PERIOD),
        }
    }

    pub(crate) fn peers(&self) -> &Peers {
        &self.peers
    }

    pub(crate) fn undecodable(&self) -> u64 {
        self.undecodable.load(Relaxed)
    }

    pub(crate) fn lost(&self) -> u64 {
        self.lost.load(Relaxed)
    }

    /// The counter behind [`Stats::lost`].
    pub(crate) fn lost_counter(&self) -> Arc<AtomicU64> {
        Arc::clone(&self.lost)
    }

    /// Decodes a sample and counts what comes of it.
    pub(crate) fn decode<M: RosMessage>(&self, sample: Sample<'_, M>) -> Option<Arc<M>> {
        let message = match sample {
            Sample::Shared(message) => Some(message),
            Sample::Cdr(bytes) => cdr::from_slice::<M>(bytes)
                .inspect_err(|why| self.not_decodable(why))
                .ok()
                .map(Arc::new),
        };
        if message.is_some() {
            self.received.fetch_add(1, Relaxed);
        }
        message
    }

    fn not_decodable(&self, why: &dyn std::fmt::Display) {
        let count = self.undecodable.fetch_add(1, Relaxed).saturating_add(1);
        if self.warning.check().is_some() {
            log::warn!(
                "{}: undecodable sample ({count} so far): {why}",
                self.peers.topic()
            );
        }
    }
}

/// A message as a subscription gets it.
pub(crate) enum Sample<'a, M> {
    /// From this process.
    Shared(Arc<M>),
    /// From another process, encapsulation header first. The buffer may be taken.
    Cdr(&'a mut Vec<u8>),
}

/// A message that is decoded on the thread that needs it, not on the one that received it.
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

    /// Length in bytes; `shared` measures a message that comes from this process.
    pub fn bytes(&self, shared: impl FnOnce(&M) -> usize) -> usize {
        match &self.content {
            Content::Shared(message) => shared(message),
            Content::Cdr(bytes) => bytes.len(),
        }
    }

    /// The message. `None`: the bytes are no message of the type, which is counted and logged.
    pub fn decode(self) -> Option<Arc<M>> {
        let Self { content, stats } = self;
        match content {
            Content::Shared(message) => stats.decode(Sample::Shared(message)),
            Content::Cdr(mut bytes) => stats.decode(Sample::Cdr(&mut bytes)),
        }
    }
}

/// Everything one subscription hears.
pub(crate) struct Source {
    pub commands: Receiver<Command>,
    pub local: Receiver<AnyMessage>,
    pub _membership: Membership,
    pub stats: Arc<Stats>,
}

impl Source {
    /// Gives messages to the handler until the task is dropped.
    pub(crate) async fn run<M: RosMessage>(self, mut handler: impl FnMut(Sample<'_, M>)) {
        let mut turn: u32 = 0;
        let mut gaps = Gaps::default();
        let mut reader: Option<Box<DdsReader>> = None;
        loop {
            turn = turn.wrapping_add(1);
            if turn.is_multiple_of(MESSAGES_PER_TURN) {
                smol::future::yield_now().await;
            }
            match self.next(reader.as_deref(), turn.is_multiple_of(2)).await {
                Heard::Local(message) => give_shared(message, &mut handler),
                Heard::Remote(Ok(origin)) => {
                    let gap = gaps.before(origin.writer, origin.sequence_number.into());
                    self.stats.lost.fetch_add(gap, Relaxed);
                    if let Some(reader) = &reader {
                        handler(Sample::Cdr(&mut reader.bytes()));
                    }
                }
                Heard::Remote(Err(why)) => self.stats.not_decodable(&why),
                Heard::Command(Command::Use(new)) => reader = Some(new),
                Heard::Command(Command::Close(done)) => {
                    reader = None;
                    drop(done);
                }
                Heard::Command(Command::WorkOff(done)) => {
                    for _ in 0..self.local.len() {
                        let message = self.local.try_recv();
                        message
                            .into_iter()
                            .for_each(|m| give_shared(m, &mut handler));
                    }
                    drop(done);
                }
                Heard::End => return,
            }
        }
    }

    /// Both sides get their turn, whichever has more to say.
    async fn next(&self, reader: Option<&DdsReader>, local_first: bool) -> Heard {
        let command = async {
            self.commands
                .recv()
                .await
                .map_or(Heard::End, Heard::Command)
        };
        let local = async { self.local.recv().await.map_or(Heard::End, Heard::Local) };
        let remote = async {
            match reader {
                Some(reader) => Heard::Remote(reader.next().await),
                None => pending().await,
            }
        };
        if local_first {
            or(command, or(local, remote)).await
        } else {
            or(command, or(remote, local)).await
        }
    }
}

fn give_shared<M: RosMessage>(message: AnyMessage, handler: &mut impl FnMut(Sample<'_, M>)) {
    if let Ok(message) = message.downcast::<M>() {
        handler(Sample::Shared(message));
    }
}

enum Heard {
    Command(Command),
    Local(AnyMessage),
    Remote(Result<SampleOrigin, String>),
    End,
}

/// Finds the samples that a writer numbered and we never saw.
#[derive(Default)]
struct Gaps {
    last: BTreeMap<GUID, i64>,
}

impl Gaps {
    /// Samples missing between the one before and this one of the same writer.
    fn before(&mut self, writer: GUID, number: i64) -> u64 {
        if self.last.len() >= MAX_WRITERS && !self.last.contains_key(&writer) {
            self.last.clear();
        }
        let last = self.last.entry(writer).or_insert(number.saturating_sub(1));
        let gap = number.saturating_sub(*last).saturating_sub(1);
        *last = number.max(*last);
        u64::try_from(gap).unwrap_or(0)
    }
}

/// Runs a subscription on a thread of its own until the sender is dropped.
pub(crate) fn spawn_reader(
    shutdown: &Shutdown,
    task: impl Future<Output = ()> + Send + 'static,
) -> Result<(Sender<()>, JoinHandle<()>), RuntimeError> {
    let (stop, stopped) = bounded::<()>(1);
    let shutdown = shutdown.clone();
    let thread = std::thread::Builder::new()
        .name("reader".to_owned())
        .spawn(move || {
            guarded("reader", &shutdown, || {
                smol::future::block_on(smol::future::or(task, async {
                    // Ends when the sender closes.
                    let _ = stopped.recv().await;
                }));
            });
        })?;
    Ok((stop, thread))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_counted_for_each_writer() {
        let (a, b) = (GUID::from_bytes([1; 16]), GUID::from_bytes([2; 16]));
        let mut gaps = Gaps::default();
        let steps = [
            (a, 7, 0),
            (b, 1, 0),
            (a, 8, 0),
            (b, 5, 3),
            (a, 8, 0),
            (a, 7, 0),
            (a, 10, 1),
        ];
        for (writer, number, gap) in steps {
            assert_eq!(gaps.before(writer, number), gap, "{number}");
        }
        assert_eq!(gaps.before(a, i64::MAX), (i64::MAX - 11) as u64);
        assert_eq!(gaps.before(a, i64::MIN), 0);
    }
}
