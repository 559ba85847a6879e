//! Subscriptions: a callback on a Zenoh thread stores samples and never blocks.

use std::iter;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex, MutexGuard};
use std::task::{Context, Poll};
use std::time::Duration;

use zenoh::Wait;
use zenoh::bytes::ZBytes;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::sample::{Locality, Sample, SampleKind};
use zenoh_ext::{AdvancedSubscriber, AdvancedSubscriberBuilderExt, HistoryConfig, RecoveryConfig};

use super::attachment::read;
use super::graph::{Graph, Place};
use crate::sync::lock;
use crate::transport::arrivals::Arrivals;
use crate::transport::gaps::Gaps;
use crate::transport::port::{EndpointId, Origin, ReaderLosses, SampleReader};
use crate::transport::qos::{Durability, Qos, Reliability};

/// Timeout of the query to publishers' caches.
const HISTORY_TIMEOUT: Duration = Duration::from_secs(600);

/// A received sample, or the reason for its rejection.
pub(super) type Arrival = Result<(ZBytes, Origin), String>;

/// Received samples that wait for the reading task.
pub(super) struct Inbox {
    arrivals: Arrivals<Arrival>,
    buffer: Mutex<Vec<u8>>,
    max_bytes: usize,
}

impl Inbox {
    pub(super) fn new(depth: usize, max_bytes: usize) -> Arc<Self> {
        Arc::new(Self {
            arrivals: Arrivals::new(depth),
            buffer: Mutex::default(),
            max_bytes,
        })
    }

    /// Stores a sample; the payload of an oversized one is dropped.
    pub(super) fn push(&self, payload: ZBytes, origin: Result<Origin, String>) {
        let (bytes, max) = (payload.len(), self.max_bytes);
        let arrival = match origin {
            Ok(_) if bytes > max => Err(format!("{bytes} bytes exceed max_message_bytes = {max}")),
            Ok(origin) => Ok((payload, origin)),
            Err(why) => Err(format!("a sample {why}")),
        };
        let mut one = iter::once(arrival);
        self.arrivals.take_from(|| one.next());
    }

    fn poll_next(&self, context: &mut Context<'_>) -> Poll<Result<Origin, String>> {
        self.arrivals.poll_next(context).map(|arrival| {
            let (payload, origin) = arrival?;
            let mut buffer = lock(&self.buffer);
            buffer.clear();
            payload
                .slices()
                .for_each(|slice| buffer.extend_from_slice(slice));
            Ok(origin)
        })
    }

    /// Counters of lost samples.
    pub(super) fn losses(&self) -> &ReaderLosses {
        self.arrivals.losses()
    }
}

/// Reader of an inbox; owns its source.
pub(super) struct InboxReader<S> {
    pub id: EndpointId,
    pub inbox: Arc<Inbox>,
    pub _source: S,
}

/// Source of a subscription.
pub(super) struct Subscribed {
    // Field order is drop order: the token before the subscription.
    _token: LivelinessToken,
    _place: Place,
    _receiver: Receiver,
}

/// A subscription with or without history; kept until it is undeclared.
#[expect(dead_code, reason = "held until it is dropped")]
enum Receiver {
    Plain(Subscriber<()>),
    WithHistory(AdvancedSubscriber<()>),
}

impl InboxReader<Subscribed> {
    /// Subscribes to one topic.
    pub(super) fn subscribe(
        session: &zenoh::Session,
        (id, key): (EndpointId, String),
        qos: &Qos,
        max_bytes: usize,
        graph: &Arc<Graph>,
        announce: impl FnOnce() -> zenoh::Result<(LivelinessToken, Place)>,
    ) -> zenoh::Result<Self> {
        let inbox = Inbox::new(qos.depth, max_bytes);
        let gaps = Mutex::new(Gaps::default());
        let (to, graph) = (Arc::clone(&inbox), Arc::clone(graph));
        let take = move |sample: Sample| {
            if sample.kind() == SampleKind::Put {
                take(&sample, &to, &gaps, &graph);
            }
        };
        let builder = session
            .declare_subscriber(key)
            .callback(take)
            .allowed_origin(Locality::Remote);
        let receiver = match qos.durability {
            Durability::Volatile => Receiver::Plain(builder.wait()?),
            Durability::TransientLocal => {
                let history = HistoryConfig::default()
                    .detect_late_publishers()
                    .max_samples(qos.depth.max(1));
                let builder = builder
                    .history(history)
                    .query_timeout(HISTORY_TIMEOUT)
                    .subscriber_detection();
                Receiver::WithHistory(match qos.reliability {
                    Reliability::BestEffort => builder.wait()?,
                    Reliability::Reliable => builder
                        .recovery(RecoveryConfig::default().heartbeat())
                        .wait()?,
                })
            }
        };
        let (token, place) = announce()?;
        Ok(Self {
            id,
            inbox,
            _source: Subscribed {
                _token: token,
                _place: place,
                _receiver: receiver,
            },
        })
    }
}

/// Handle of a publisher, which Zenoh discovers once.
const HANDLE: u64 = 0;

fn take(sample: &Sample, inbox: &Inbox, gaps: &Mutex<Gaps>, graph: &Graph) {
    let origin = match read(sample.attachment()) {
        // Caches of this process reply too.
        Ok(sample) if graph.is_ours(&sample.writer) => return,
        Ok(sample) => {
            let missing = lock(gaps).note(sample.writer, HANDLE, sample.number);
            inbox.losses().on_network.fetch_add(missing, Relaxed);
            Ok(Origin {
                sample,
                related: None,
            })
        }
        Err(why) => Err(why),
    };
    inbox.push(sample.payload().clone(), origin);
}

impl<S: Send + Sync> SampleReader for InboxReader<S> {
    fn id(&self) -> EndpointId {
        self.id
    }

    fn poll_next(&self, context: &mut Context<'_>) -> Poll<Result<Origin, String>> {
        self.inbox.poll_next(context)
    }

    fn bytes(&self) -> MutexGuard<'_, Vec<u8>> {
        lock(&self.inbox.buffer)
    }

    fn losses(&self) -> ReaderLosses {
        self.inbox.losses().clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::port::SampleId;

    #[test]
    fn what_is_too_long_or_nameless_is_an_error_and_the_next_can_be_had() {
        let inbox = Inbox::new(10, 8);
        let origin = Origin {
            sample: SampleId {
                writer: EndpointId([1; 16]),
                number: 1,
            },
            related: None,
        };
        inbox.push(ZBytes::from(vec![0; 9]), Ok(origin));
        inbox.push(ZBytes::from(vec![0; 4]), Err("has no name".to_owned()));
        inbox.push(ZBytes::from(vec![7; 8]), Ok(origin));
        let mut context = Context::from_waker(std::task::Waker::noop());
        let mut next = || inbox.poll_next(&mut context);
        assert!(matches!(next(), Poll::Ready(Err(why)) if why.contains("max_message_bytes = 8")));
        assert!(matches!(next(), Poll::Ready(Err(why)) if why.contains("has no name")));
        assert!(matches!(next(), Poll::Ready(Ok(_))));
        assert_eq!(*lock(&inbox.buffer), [7; 8]);
    }
}
