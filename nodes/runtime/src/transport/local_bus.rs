//! Intra-process delivery: messages are shared as `Arc` by topic name.
//!
//! Cyclone's participant ignores its own endpoints, which saves a copy through sockets.

use std::any::{Any, TypeId};
use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex};

use lattice_msgs::RosMessage;
use lattice_msgs::cdr::{self, CdrError};
use smol::channel::Sender;

use super::peers::Peers;
use super::port::Bytes;
use crate::error::RuntimeError;
use crate::sync::lock;

/// Type-erased message.
pub(crate) type AnyMessage = Arc<dyn Any + Send + Sync>;

/// Intra-process topics of a runtime.
#[derive(Default)]
pub(crate) struct LocalBus {
    topics: Mutex<BTreeMap<String, Arc<Topic>>>,
}

impl LocalBus {
    /// Topic of a resolved name.
    pub(crate) fn topic(&self, name: &str) -> Arc<Topic> {
        let mut topics = lock(&self.topics);
        let topic = topics.entry(name.to_owned()).or_insert_with(|| {
            Arc::new(Topic {
                name: name.to_owned(),
                inner: Mutex::default(),
            })
        });
        Arc::clone(topic)
    }
}

/// An intra-process topic.
pub(crate) struct Topic {
    name: String,
    inner: Mutex<Inner>,
}

#[derive(Default)]
struct Inner {
    next_id: u64,
    /// Counter of changes of publishers and subscribers.
    change: u64,
    type_name: Option<String>,
    rust_type: Option<(TypeId, Decode)>,
    publishers: Vec<PublisherEntry>,
    subscribers: Vec<SubscriberEntry>,
}

type Decode = fn(&[u8]) -> Result<AnyMessage, CdrError>;

struct PublisherEntry {
    id: u64,
    peers: Arc<Peers>,
    latched: VecDeque<Latched>,
    latch_depth: usize,
}

#[derive(Clone)]
enum Latched {
    Message(AnyMessage),
    Cdr(Bytes),
}

struct SubscriberEntry {
    id: u64,
    peers: Arc<Peers>,
    sender: Sender<AnyMessage>,
    lost: Arc<AtomicU64>,
}

/// Intra-process publisher or subscriber; dropping it leaves the topic.
pub(crate) struct LocalEndpoint {
    topic: Arc<Topic>,
    id: u64,
}

impl Topic {
    /// Adds a publisher of `M` that keeps its last `latch_depth` messages for late joiners.
    pub(crate) fn join_publisher<M: RosMessage>(
        self: &Arc<Self>,
        peers: &Arc<Peers>,
        latch_depth: usize,
    ) -> Result<LocalEndpoint, RuntimeError> {
        self.join(
            |inner| inner.claim_rust_type::<M>(&self.name),
            |inner, id| inner.add_publisher(id, peers, latch_depth),
        )
    }

    /// Adds a publisher of CDR bytes of the type.
    pub(crate) fn join_raw_publisher(
        self: &Arc<Self>,
        type_name: &str,
        peers: &Arc<Peers>,
        latch_depth: usize,
    ) -> Result<LocalEndpoint, RuntimeError> {
        self.join(
            |inner| inner.claim_type(&self.name, type_name),
            |inner, id| inner.add_publisher(id, peers, latch_depth),
        )
    }

    /// Adds a subscriber; `latched`: receives the kept messages of publishers. `lost` counts messages overwritten
    /// by newer ones in a full queue.
    pub(crate) fn join_subscriber<M: RosMessage>(
        self: &Arc<Self>,
        peers: &Arc<Peers>,
        sender: Sender<AnyMessage>,
        lost: Arc<AtomicU64>,
        latched: bool,
    ) -> Result<LocalEndpoint, RuntimeError> {
        self.join(
            |inner| inner.claim_rust_type::<M>(&self.name),
            |inner, id| {
                if latched {
                    for message in inner.latched() {
                        // A full queue contains newer messages than this one.
                        let _ = sender.force_send(message);
                    }
                }
                inner.subscribers.push(SubscriberEntry {
                    id,
                    peers: Arc::clone(peers),
                    sender,
                    lost,
                });
            },
        )
    }

    fn join(
        self: &Arc<Self>,
        claim: impl FnOnce(&mut Inner) -> Result<(), RuntimeError>,
        add: impl FnOnce(&mut Inner, u64),
    ) -> Result<LocalEndpoint, RuntimeError> {
        let mut inner = lock(&self.inner);
        claim(&mut inner)?;
        let id = inner.next_id;
        inner.next_id = id.wrapping_add(1);
        add(&mut inner, id);
        let counts = inner.count();
        drop(inner);
        counts.hand_on();
        Ok(LocalEndpoint {
            topic: Arc::clone(self),
            id,
        })
    }
}

/// Endpoint counts of a topic after one change.
struct Counts {
    change: u64,
    publishers: Vec<Arc<Peers>>,
    subscribers: Vec<Arc<Peers>>,
}

impl Counts {
    /// Passes each side the count of the other; called without the lock, since it runs callbacks.
    fn hand_on(&self) {
        for peers in &self.publishers {
            peers.set_local(self.subscribers.len(), self.change);
        }
        for peers in &self.subscribers {
            peers.set_local(self.publishers.len(), self.change);
        }
    }
}

impl LocalEndpoint {
    /// Delivers a message to all subscribers.
    pub(crate) fn publish(&self, message: &AnyMessage) {
        let mut inner = lock(&self.topic.inner);
        inner.latch(self.id, || Latched::Message(Arc::clone(message)));
        inner.deliver(message);
    }

    /// Delivers CDR bytes, header included, to all subscribers, decoded once.
    pub(crate) fn publish_cdr(&self, cdr: &Bytes) -> Result<(), CdrError> {
        let mut inner = lock(&self.topic.inner);
        inner.latch(self.id, || Latched::Cdr(cdr.clone()));
        match inner.rust_type {
            Some((_, decode)) if !inner.subscribers.is_empty() => {
                inner.deliver(&decode(cdr)?);
                Ok(())
            }
            _ => Ok(()),
        }
    }
}

impl Drop for LocalEndpoint {
    fn drop(&mut self) {
        let mut inner = lock(&self.topic.inner);
        inner.publishers.retain(|p| p.id != self.id);
        inner.subscribers.retain(|s| s.id != self.id);
        if inner.publishers.is_empty() && inner.subscribers.is_empty() {
            (inner.type_name, inner.rust_type) = (None, None);
        }
        let counts = inner.count();
        drop(inner);
        counts.hand_on();
    }
}

impl Inner {
    fn count(&mut self) -> Counts {
        self.change = self.change.wrapping_add(1);
        let publishers = self.publishers.iter().map(|p| Arc::clone(&p.peers));
        let subscribers = self.subscribers.iter().map(|s| Arc::clone(&s.peers));
        Counts {
            change: self.change,
            publishers: publishers.collect(),
            subscribers: subscribers.collect(),
        }
    }

    fn claim_type(&mut self, topic: &str, want: &str) -> Result<(), RuntimeError> {
        match &self.type_name {
            Some(have) if have != want => Err(RuntimeError::TypeMismatch {
                topic: topic.to_owned(),
                have: have.clone(),
                want: want.to_owned(),
            }),
            _ => {
                self.type_name = Some(want.to_owned());
                Ok(())
            }
        }
    }

    fn claim_rust_type<M: RosMessage>(&mut self, topic: &str) -> Result<(), RuntimeError> {
        self.claim_type(topic, M::TYPE)?;
        match self.rust_type {
            Some((have, _)) if have != TypeId::of::<M>() => Err(RuntimeError::TypeMismatch {
                topic: topic.to_owned(),
                have: format!("another Rust type of {}", M::TYPE),
                want: std::any::type_name::<M>().to_owned(),
            }),
            _ => {
                self.rust_type = Some((TypeId::of::<M>(), |bytes| {
                    let message: AnyMessage = Arc::new(cdr::from_slice::<M>(bytes)?);
                    Ok(message)
                }));
                Ok(())
            }
        }
    }

    fn add_publisher(&mut self, id: u64, peers: &Arc<Peers>, latch_depth: usize) {
        self.publishers.push(PublisherEntry {
            id,
            peers: Arc::clone(peers),
            latched: VecDeque::new(),
            latch_depth,
        });
    }

    fn latch(&mut self, id: u64, message: impl FnOnce() -> Latched) {
        let publisher = self.publishers.iter_mut().find(|p| p.id == id);
        if let Some(publisher) = publisher.filter(|p| p.latch_depth > 0) {
            while publisher.latched.len() >= publisher.latch_depth {
                publisher.latched.pop_front();
            }
            publisher.latched.push_back(message());
        }
    }

    fn latched(&self) -> Vec<AnyMessage> {
        let kept = self.publishers.iter().flat_map(|p| &p.latched);
        kept.filter_map(|latched| match latched {
            Latched::Message(message) => Some(Arc::clone(message)),
            Latched::Cdr(bytes) => {
                let (_, decode) = self.rust_type?;
                decode(bytes)
                    .inspect_err(|error| log::warn!("latched message not decodable: {error}"))
                    .ok()
            }
        })
        .collect()
    }

    fn deliver(&self, message: &AnyMessage) {
        for subscriber in &self.subscribers {
            if let Ok(Some(_)) = subscriber.sender.force_send(Arc::clone(message)) {
                subscriber.lost.fetch_add(1, Relaxed);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use lattice_msgs::std_msgs::{Header, String as RosString};
    use smol::channel::{Receiver, bounded};

    use super::*;

    fn text(s: &str) -> Arc<RosString> {
        Arc::new(RosString { data: s.to_owned() })
    }

    fn peers() -> Arc<Peers> {
        Arc::new(Peers::new("/a", "peer", log::Level::Info))
    }

    fn publisher(bus: &LocalBus, latch: usize) -> (LocalEndpoint, Arc<Peers>) {
        let peers = peers();
        let joined = bus.topic("/a").join_publisher::<RosString>(&peers, latch);
        (joined.unwrap(), peers)
    }

    /// A subscriber with its queue, its peers and what it lost.
    struct Subscriber {
        endpoint: LocalEndpoint,
        queue: Receiver<AnyMessage>,
        peers: Arc<Peers>,
        lost: Arc<AtomicU64>,
    }

    impl Subscriber {
        fn new(bus: &LocalBus, depth: usize) -> Self {
            let ((sender, queue), peers, lost) = (bounded(depth), peers(), Arc::default());
            let (topic, lost_here) = (bus.topic("/a"), Arc::clone(&lost));
            let joined = topic.join_subscriber::<RosString>(&peers, sender, lost_here, true);
            Self {
                endpoint: joined.unwrap(),
                queue,
                peers,
                lost,
            }
        }

        fn next(&self) -> Option<Arc<RosString>> {
            self.queue.try_recv().ok()?.downcast::<RosString>().ok()
        }
    }

    #[test]
    fn the_same_message_arrives_and_counts_follow() {
        let bus = LocalBus::default();
        let (publisher, peers) = publisher(&bus, 0);
        let subscriber = Subscriber::new(&bus, 2);
        assert_eq!((peers.count(), subscriber.peers.count()), (1, 1));
        let message = text("x");
        publisher.publish(&(message.clone() as _));
        assert!(Arc::ptr_eq(&subscriber.next().unwrap(), &message));
        for s in ["1", "2", "3"] {
            publisher.publish(&(text(s) as _));
        }
        assert_eq!(subscriber.next().unwrap().data, "2", "the oldest gives way");
        assert_eq!(subscriber.lost.load(Relaxed), 1);
        drop(subscriber.endpoint);
        assert_eq!(peers.count(), 0);
    }

    #[test]
    fn late_joiners_hear_what_was_latched() {
        let bus = LocalBus::default();
        let (publisher, _peers) = publisher(&bus, 2);
        for s in ["1", "2", "3"] {
            publisher.publish(&(text(s) as _));
        }
        let topic = bus.topic("/a");
        let raw = topic.join_raw_publisher(RosString::TYPE, &peers(), 1);
        let raw = raw.unwrap();
        raw.publish_cdr(&cdr::to_vec(&*text("raw")).unwrap().into())
            .unwrap();
        let subscriber = Subscriber::new(&bus, 5);
        let heard = std::iter::from_fn(|| subscriber.next());
        let heard: Vec<_> = heard.map(|m| m.data.clone()).collect();
        assert_eq!(heard, ["2", "3", "raw"]);
    }

    #[test]
    fn two_types_on_one_topic_are_refused() {
        let bus = LocalBus::default();
        let (publisher, peers) = publisher(&bus, 0);
        let join = || bus.topic("/a").join_publisher::<Header>(&peers, 0);
        assert!(matches!(join(), Err(RuntimeError::TypeMismatch { .. })));
        drop(publisher);
        assert!(join().is_ok());
    }
}
