//! Subscriptions of the process.

use std::any::Any;
use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;

use lattice_msgs::{RosMessage, know_message};
use smol::channel::{Sender, bounded, unbounded};

use super::status::MAX_LOSSES;
use super::{Shared, closed};
use crate::communication::subscription::{
    Intake, Running, Sample, Source, Stats, Subscription, SubscriptionExecutor, spawn_reader,
};
use crate::error::RuntimeError;
use crate::graph::local_graph::NodeId;
use crate::sync::lock;
use crate::transport::local_bus::{AnyMessage, LocalEndpoint, Topic};
use crate::transport::peers::Peers;
use crate::transport::port::{EndpointKind, PortTopic};
use crate::transport::qos::{Durability, Qos};
use crate::transport::remote::GraphRole;

/// Queue length for small messages of publishers in this process. Messages are
/// shared, not copied, and their handler returns at once.
const LOCAL_SMALL_MESSAGES: usize = 1024;

/// Queue length for large messages: several bursts of line scans, and a bounded number of 4 MB clouds.
const LOCAL_LARGE_MESSAGES: usize = 128;

/// Function that joins a subscription to the local bus.
type Join = fn(
    &Arc<Topic>,
    &Arc<Peers>,
    Sender<AnyMessage>,
    Arc<AtomicU64>,
    bool,
) -> Result<Option<LocalEndpoint>, RuntimeError>;

impl Shared {
    pub(crate) fn subscribe<M: RosMessage>(
        self: &Arc<Self>,
        node: NodeId,
        topic: &str,
        qos: &Qos,
        executor: SubscriptionExecutor,
        max_bytes: usize,
        handler: impl FnMut(Sample<'_, M>, &Arc<Stats>) + Send + 'static,
    ) -> Result<Subscription, RuntimeError> {
        know_message::<M>();
        let join: Join = |topic, peers, sender, lost, latched| {
            topic
                .join_subscriber::<M>(peers, sender, lost, latched)
                .map(Some)
        };
        self.subscribe_with(
            node,
            (topic, M::TYPE),
            qos,
            executor,
            max_bytes,
            join,
            handler,
        )
    }

    /// Subscribes to any type, as CDR bytes, without messages of this process.
    pub(crate) fn subscribe_raw(
        self: &Arc<Self>,
        node: NodeId,
        of: (&str, &str),
        qos: &Qos,
        executor: SubscriptionExecutor,
        max_bytes: usize,
        mut handler: impl FnMut(Vec<u8>) + Send + 'static,
    ) -> Result<Subscription, RuntimeError> {
        let take = move |sample: Sample<'_, Infallible>, stats: &Arc<Stats>| {
            handler(stats.take_bytes(sample));
        };
        let join: Join = |_, _, _, _, _| Ok(None);
        self.subscribe_with(node, of, qos, executor, max_bytes, join, take)
    }

    #[expect(
        clippy::too_many_arguments,
        reason = "one for each property of a subscription"
    )]
    fn subscribe_with<M: Any + Send + Sync>(
        self: &Arc<Self>,
        node: NodeId,
        (topic, type_name): (&str, &str),
        qos: &Qos,
        executor: SubscriptionExecutor,
        max_bytes: usize,
        join: Join,
        mut handler: impl FnMut(Sample<'_, M>, &Arc<Stats>) + Send + 'static,
    ) -> Result<Subscription, RuntimeError> {
        let peers = Arc::new(Peers::new(topic, "publisher", log::Level::Info));
        let port_topic = PortTopic {
            node: &self.graph.node(node),
            name: topic,
            ros_type: type_name,
            type_hash: None,
        };
        let reader = self.reader(port_topic, qos, max_bytes)?;
        let stats = Arc::new(Stats::new(Arc::clone(&peers), reader.losses()));
        let (sender, local) = bounded(qos.depth.max(match executor {
            SubscriptionExecutor::Shared => LOCAL_SMALL_MESSAGES,
            SubscriptionExecutor::Dedicated => LOCAL_LARGE_MESSAGES,
        }));
        let (place, overrun) = (self.bus.topic(topic), Arc::clone(&stats.losses.overrun));
        let latched = qos.durability == Durability::TransientLocal;
        let place = join(&place, &peers, sender.clone(), overrun, latched)?;
        let id = reader.id();
        let of = Some((GraphRole::Subscriber, topic.to_owned()));
        let (orders, given) = unbounded();
        let intake = Arc::new(Intake {
            topic: topic.to_owned(),
            type_name: type_name.to_owned(),
            peers: Arc::clone(&peers),
            stats: Arc::clone(&stats),
            orders,
            _graph: (self.graph).join(node, EndpointKind::Reader, id, of),
        });
        let source = Source {
            reader,
            orders: given,
            local,
            _local: place,
            _sender: sender,
            stats: Arc::clone(&stats),
        };
        let activity = self.activity.clone();
        peers.on_joined(Box::new(move || activity.note()));
        let activity = self.activity.clone();
        let task = source.run(move |sample: Sample<'_, M>| {
            handler(sample, &stats);
            // After the handler: a timer finds the message handed over.
            activity.note();
        });
        let running = match executor {
            SubscriptionExecutor::Shared => Running::OnIoThread {
                _task: self.io.spawn(task).ok_or_else(|| closed(topic))?,
            },
            SubscriptionExecutor::Dedicated => {
                let (stop, thread) = spawn_reader(&self.shutdown, task)?;
                if let Some(open) = lock(&self.open).as_mut() {
                    open.readers.retain(|(_, thread)| !thread.is_finished());
                    open.readers.push((stop.clone(), thread));
                }
                Running::OnOwnThread { _stop: stop }
            }
        };
        if let Some(open) = lock(&self.open).as_mut() {
            open.intakes.retain(|intake| intake.strong_count() > 0);
            open.intakes.push(Arc::downgrade(&intake));
            let counts = (intake.topic.clone(), Arc::clone(&intake.stats));
            open.subscribed.push_back(counts);
            if open.subscribed.len() > MAX_LOSSES {
                open.subscribed.pop_front();
            }
        }
        self.endpoints.register(id, &peers);
        Ok(Subscription {
            intake,
            _running: running,
        })
    }
}
