//! Publishers: samples are sent in order, on threads that may block on a full link.

use std::sync::Arc;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicI64, Ordering::Relaxed};
use std::time::{Duration, Instant};

use futures::future::{BoxFuture, Either, select};
use smol::{Task, Timer, block_on};
use zenoh::Wait;
use zenoh::bytes::ZBytes;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Publisher;
use zenoh::qos::CongestionControl;
use zenoh::sample::Locality;
use zenoh_ext::{AdvancedPublisher, AdvancedPublisherBuilderExt, CacheConfig, MissDetectionConfig};

use super::attachment::attachment;
use super::error_text::words;
use super::graph::Place;
use crate::sync::lock;
use crate::transport::port::{Bytes, EndpointId, SampleId, SampleWriter, WriteRefusal};
use crate::transport::qos::{Durability, Qos, Reliability};

/// Encapsulation header of little-endian CDR.
const LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];

/// Heartbeat period, which lets subscribers detect lost samples; the value of rmw_zenoh.
const HEARTBEAT: Duration = Duration::from_millis(500);

/// A publisher with or without a cache for late joiners.
enum Sender {
    Plain(Publisher<'static>),
    Cached(AdvancedPublisher<'static>),
}

impl Sender {
    fn put(&self, payload: ZBytes, attachment: ZBytes) -> zenoh::Result<()> {
        match self {
            Self::Plain(publisher) => publisher.put(payload).attachment(attachment).wait(),
            Self::Cached(publisher) => publisher.put(payload).attachment(attachment).wait(),
        }
    }

    /// Flag, updated by Zenoh: a subscription of another session has a matching key, also one without a token.
    fn has_reader(&self) -> zenoh::Result<Arc<AtomicBool>> {
        let has_reader = Arc::new(AtomicBool::new(false));
        let to = Arc::clone(&has_reader);
        let listener = match self {
            Self::Plain(publisher) => publisher.matching_listener(),
            Self::Cached(publisher) => publisher.matching_listener(),
        };
        listener
            .callback(move |status| to.store(status.matching(), Relaxed))
            .background()
            .wait()?;
        Ok(has_reader)
    }
}

/// Writer of one topic.
pub(super) struct ZenohPublisher {
    id: EndpointId,
    sender: Arc<Sender>,
    has_reader: Arc<AtomicBool>,
    next: AtomicI64,
    queue: InTurn,
    // Field order is drop order: the token before the publisher.
    _token: LivelinessToken,
    _place: Place,
}

impl ZenohPublisher {
    pub(super) fn new(
        session: &zenoh::Session,
        (id, key): (EndpointId, String),
        qos: &Qos,
        announce: impl FnOnce() -> zenoh::Result<(LivelinessToken, Place)>,
    ) -> zenoh::Result<Self> {
        // Local subscriptions are served without the network.
        let builder = session
            .declare_publisher(key)
            .allowed_destination(Locality::Remote)
            .congestion_control(congestion_control(qos));
        let sender = match qos.durability {
            Durability::Volatile => Sender::Plain(builder.wait()?),
            Durability::TransientLocal => {
                let cache = CacheConfig::default().max_samples(qos.kept());
                let cached = builder.cache(cache).publisher_detection();
                Sender::Cached(match qos.reliability {
                    Reliability::BestEffort => cached.wait()?,
                    Reliability::Reliable => {
                        let misses = MissDetectionConfig::default().sporadic_heartbeat(HEARTBEAT);
                        cached.sample_miss_detection(misses).wait()?
                    }
                })
            }
        };
        let (token, place) = announce()?;
        Ok(Self {
            id,
            has_reader: sender.has_reader()?,
            sender: Arc::new(sender),
            next: AtomicI64::new(1),
            queue: InTurn::default(),
            _token: token,
            _place: place,
        })
    }
}

/// Reliable samples block on a full link; rmw_zenoh blocks for keep_all only, and drops otherwise.
pub(super) fn congestion_control(qos: &Qos) -> CongestionControl {
    match qos.reliability {
        Reliability::Reliable => CongestionControl::Block,
        Reliability::BestEffort => CongestionControl::Drop,
    }
}

/// Payload of a body after its encapsulation header, without a copy.
pub(super) fn payload(body: Bytes) -> ZBytes {
    let mut payload = ZBytes::writer();
    payload.append(ZBytes::from(LITTLE_ENDIAN.to_vec()));
    payload.append(ZBytes::from(body));
    payload.finish()
}

impl SampleWriter for ZenohPublisher {
    fn id(&self) -> EndpointId {
        self.id
    }

    fn write(&self, body: Bytes, _: Option<SampleId>) -> BoxFuture<'_, Result<(), WriteRefusal>> {
        self.queue.write(body, move |body| {
            let sample = SampleId {
                writer: self.id,
                number: self.next.fetch_add(1, Relaxed),
            };
            let (sender, attachment) = (Arc::clone(&self.sender), attachment(sample));
            move || sender.put(payload(body), attachment)
        })
    }

    fn keeps_samples(&self) -> bool {
        matches!(*self.sender, Sender::Cached(_))
    }

    fn has_reader(&self) -> bool {
        self.has_reader.load(Relaxed)
    }

    fn is_sending(&self, body: &Bytes) -> bool {
        self.queue.is_sending(body)
    }

    fn wait_for_acknowledgments(&self, patience: Duration) -> bool {
        self.queue.wait(patience)
    }
}

/// Sends samples in order, on threads that may block.
#[derive(Default)]
pub(super) struct InTurn(Mutex<Option<Running>>);

/// A sample being sent.
struct Running {
    body: Bytes,
    task: Task<zenoh::Result<()>>,
}

impl InTurn {
    /// Sends a body with the operation that `prepare` creates. Dropping the future does not cancel the operation:
    /// a retry with the same body waits for it.
    pub(super) fn write<'a, F>(
        &'a self,
        body: Bytes,
        prepare: impl FnOnce(Bytes) -> F + Send + 'a,
    ) -> BoxFuture<'a, Result<(), WriteRefusal>>
    where
        F: FnOnce() -> zenoh::Result<()> + Send + 'static,
    {
        Box::pin(async move {
            if !self.is_sending(&body) {
                // The result of the earlier sample is not that of this one.
                let _ = self.finished().await;
                let task = smol::unblock(prepare(body.clone()));
                *lock(&self.0) = Some(Running { body, task });
            }
            let written = self.finished().await;
            written.map_err(|error| WriteRefusal::Failed(words(error)))
        })
    }

    /// True if this body is being sent.
    pub(super) fn is_sending(&self, body: &Bytes) -> bool {
        lock(&self.0).as_ref().is_some_and(|running| {
            (running.body.as_ptr(), running.body.len()) == (body.as_ptr(), body.len())
        })
    }

    /// Completes when no sample is being sent.
    async fn finished(&self) -> zenoh::Result<()> {
        std::future::poll_fn(|context| {
            let mut running = lock(&self.0);
            let Some(Running { task, .. }) = running.as_mut() else {
                return std::task::Poll::Ready(Ok(()));
            };
            let result = std::task::ready!(std::pin::Pin::new(task).poll(context));
            *running = None;
            std::task::Poll::Ready(result)
        })
        .await
    }

    /// Waits until no sample is being sent. False: timeout.
    pub(super) fn wait(&self, patience: Duration) -> bool {
        let finished = std::pin::pin!(self.finished());
        let end = Instant::now().checked_add(patience);
        let late = end.map_or_else(Timer::never, Timer::at);
        matches!(block_on(select(finished, late)), Either::Left(_))
    }
}
