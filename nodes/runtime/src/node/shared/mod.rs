//! State shared by the nodes of a process: participant, threads, local bus.

mod calling;
mod listening;
mod publishing;
mod receive_buffer;
mod serving;
mod state;
mod status;
mod subscribing;

use std::collections::VecDeque;
use std::sync::atomic::{AtomicI64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, Weak};
use std::time::{Duration, Instant};

use lattice_msgs::rosgraph_msgs;

pub use self::calling::{CallError, Client};
use self::receive_buffer::ReceiveBuffer;
use crate::activity::Activity;
use crate::communication::publisher::PublisherParts;
use crate::communication::service::{Answers, LocalServices, Server, Unanswered};
use crate::communication::subscription::{Intake, Sample, Stats, SubscriptionExecutor};
use crate::config::env::{Network, TransportKind};
use crate::config::security::Enclave;
use crate::error::RuntimeError;
use crate::graph::endpoints::Endpoints;
use crate::graph::local_graph::{Graph, NodeId};
use crate::shutdown::Shutdown;
use crate::sync::{lock, wait_for};
use crate::task_thread::TaskThread;
use crate::transport::cyclone::Cyclone;
use crate::transport::local_bus::LocalBus;
use crate::transport::outbox::{Outbox, WhenFull};
use crate::transport::port::{GRAPH_TOPIC, PortTopic, SampleReader, SampleWriter, Transport};
use crate::transport::qos::{Qos, Reliability};
use crate::transport::remote::RemotePublisher;
#[cfg(feature = "zenoh")]
use crate::transport::rmw_zenoh::Zenoh;
pub(crate) use state::Shared;
use state::{Open, closed};

/// Queue length of one publisher, messages.
const QUEUE_MESSAGES: usize = 1024;

/// Queue size of one publisher, bytes.
const QUEUE_BYTES: usize = 128 << 20;

/// Timeout of a shutdown: handlers, replies and queues together. A process ends within 2 s, of which a node has 0.5 s
/// before it, and the node list 0.5 s after it.
const DRAIN_TIME: Duration = Duration::from_millis(900);

/// Default limit of message length, bytes.
pub(crate) const DEFAULT_MAX_MESSAGE_BYTES: usize = 64 << 20;

impl Shared {
    pub(crate) fn start(network: &Network, enclave: &Enclave) -> Result<Arc<Self>, RuntimeError> {
        let shutdown = Shutdown::default();
        let io = TaskThread::start("io", shutdown.clone())?;
        let publishing = TaskThread::start("publisher", shutdown.clone())?;
        let transport = join(network, enclave)?;
        let activity = Activity::default();
        let endpoints = Arc::new(Endpoints::new(activity.clone()));
        let graph = Graph::new();
        let watch = Arc::clone(&endpoints).watch(transport.events());
        let watch = io.spawn(watch);
        let shared = Arc::new(Self {
            bus: LocalBus::default(),
            shutdown,
            activity,
            io,
            tasks: Arc::default(),
            receive_buffer: ReceiveBuffer::probe(network.transport),
            losses: Mutex::default(),
            sim_time: Mutex::default(),
            publishing,
            answers: Answers::default(),
            services: LocalServices::default(),
            endpoints,
            graph,
            open: Mutex::new(Some(Open {
                transport,
                _watch: watch,
                publishers: Vec::new(),
                intakes: Vec::new(),
                subscribed: VecDeque::new(),
                readers: Vec::new(),
                servers: Vec::new(),
                unanswered: Vec::new(),
                graph: None,
                graph_of_others: None,
            })),
        });
        shared.publish_graph()?;
        Ok(shared)
    }

    /// Publishes the node list, unless endpoints announce their nodes.
    fn publish_graph(&self) -> Result<(), RuntimeError> {
        let writer = lock(&self.open)
            .as_ref()
            .and_then(|open| open.transport.graph_writer());
        let Some(writer) = writer.transpose()? else {
            return Ok(());
        };
        let outbox = self.outbox_of(GRAPH_TOPIC, writer, WhenFull::Drop)?;
        if let Some(open) = lock(&self.open).as_mut() {
            let graph = Arc::clone(&self.graph);
            let transport = Arc::downgrade(&open.transport);
            let publish = graph.publish(transport, Arc::clone(&outbox));
            open.graph = self.io.spawn(publish).map(|task| (task, outbox));
        }
        Ok(())
    }

    /// Adds a node; it stays until the process ends.
    pub(crate) fn add_node(&self, namespace: &str, name: &str) -> Result<NodeId, RuntimeError> {
        let id = self.graph.add_node(namespace, name);
        if let Some(open) = lock(&self.open).as_ref() {
            open.transport.add_node(&self.graph.node(id))?;
        }
        Ok(id)
    }

    /// Keeps servers until shutdown.
    pub(crate) fn keep(&self, servers: Vec<Server>) {
        if let Some(open) = lock(&self.open).as_mut() {
            open.servers.extend(servers);
        }
    }

    /// Creates a queue that the publisher thread serves until its last handle is dropped.
    fn outbox(
        &self,
        topic: PortTopic<'_>,
        qos: &Qos,
        when_full: WhenFull,
    ) -> Result<Arc<Outbox>, RuntimeError> {
        let keeps = when_full == WhenFull::Wait && qos.reliability == Reliability::Reliable;
        let writer = self.transport(topic.name, |transport| transport.writer(topic, qos, keeps))?;
        self.outbox_of(topic.name, writer, when_full)
    }

    fn outbox_of(
        &self,
        name: &str,
        writer: Arc<dyn SampleWriter>,
        when_full: WhenFull,
    ) -> Result<Arc<Outbox>, RuntimeError> {
        let (outbox, task) = Outbox::new(name, writer, when_full, QUEUE_MESSAGES, QUEUE_BYTES);
        let task = self.publishing.spawn(task);
        task.ok_or_else(|| closed(name))?.detach();
        Ok(Arc::new(outbox))
    }

    /// Result of `make` on the open transport; after shutdown an error with the topic or service.
    fn transport<T>(
        &self,
        name: &str,
        make: impl FnOnce(&dyn Transport) -> Result<T, RuntimeError>,
    ) -> Result<T, RuntimeError> {
        let guard = lock(&self.open);
        let open = guard.as_ref().ok_or_else(|| closed(name))?;
        make(&*open.transport)
    }

    /// Creates a reader of samples up to `max_bytes`.
    fn reader(
        &self,
        topic: PortTopic<'_>,
        qos: &Qos,
        max_bytes: usize,
    ) -> Result<Box<dyn SampleReader>, RuntimeError> {
        self.transport(topic.name, |transport| {
            transport.reader(topic, qos, max_bytes)
        })
    }

    /// Time on `topic`, subscribed to at the first call.
    pub(crate) fn sim_clock(
        self: &Arc<Self>,
        node: NodeId,
        topic: &str,
    ) -> Result<Arc<AtomicI64>, RuntimeError> {
        let mut sim = lock(&self.sim_time);
        if let Some((now_ns, _)) = sim.as_ref() {
            return Ok(Arc::clone(now_ns));
        }
        let now_ns = Arc::new(AtomicI64::new(0));
        let shown = Arc::clone(&now_ns);
        let handler = move |sample: Sample<'_, rosgraph_msgs::Clock>, stats: &Arc<Stats>| {
            if let Some(message) = stats.decode(sample) {
                now_ns.store(message.clock.to_ns(), Relaxed);
            }
        };
        let subscription = self.subscribe(
            node,
            topic,
            &Qos::CLOCK,
            SubscriptionExecutor::Shared,
            1 << 10,
            handler,
        )?;
        *sim = Some((Arc::clone(&shown), subscription));
        Ok(shown)
    }

    /// Publishers in use.
    pub(crate) fn publishers(&self) -> Vec<Arc<PublisherParts>> {
        let open = lock(&self.open);
        let all = open.iter().flat_map(|open| &open.publishers);
        all.filter_map(Weak::upgrade).collect()
    }

    /// Publishers of other processes, on any topic.
    pub(crate) fn remote_publishers(&self) -> Vec<RemotePublisher> {
        self.endpoints.remotes.all()
    }

    /// Subscriptions in use.
    pub(crate) fn intakes(&self) -> Vec<Arc<Intake>> {
        let open = lock(&self.open);
        let all = open.iter().flat_map(|open| &open.intakes);
        all.filter_map(Weak::upgrade).collect()
    }

    /// Counters of recent subscriptions by topic, ended ones included.
    fn subscribed(&self) -> Vec<(String, Arc<Stats>)> {
        let open = lock(&self.open);
        let all = open.iter().flat_map(|open| &open.subscribed);
        all.cloned().collect()
    }

    /// Requests without reply, of all servers.
    pub(crate) fn unanswered(&self) -> Vec<Arc<Unanswered>> {
        let open = lock(&self.open);
        let all = open.iter().flat_map(|open| &open.unanswered);
        all.filter_map(Weak::upgrade).collect()
    }

    /// Number of participants rejected by DDS Security.
    fn unauthenticated_participants(&self) -> usize {
        let open = lock(&self.open);
        open.as_ref()
            .map_or(0, |open| open.transport.unauthenticated_participants())
    }

    /// Waits until the handlers have processed the queued messages of this process. Not from a thread of the runtime.
    pub(crate) fn work_off(&self, deadline: Instant) {
        let orders: Vec<_> = (self.intakes().into_iter())
            .filter_map(|intake| Some((intake.work_off()?, intake)))
            .collect();
        for (order, intake) in orders {
            if !wait_for(&order, deadline) {
                let topic = &intake.topic;
                log::warn!("{topic}: queued messages of this process were not handled");
            }
        }
    }

    /// Shuts the runtime down: handlers and clients receive their last messages, timers and readers end, queues
    /// are sent, and the participant leaves.
    ///
    /// Not from a thread of the runtime.
    pub(crate) fn close(&self) {
        self.shutdown.request();
        let deadline = deadline();
        if lock(&self.open).is_some() {
            self.work_off(deadline);
        }
        let answers = self.answers.end(deadline);
        let Some(open) = lock(&self.open).take() else {
            return;
        };
        self.io.stop();
        for (stop, thread) in open.readers {
            stop.close();
            // The thread has reported its own panic.
            let _ = thread.join();
        }
        let publishers = open.publishers.iter().filter_map(Weak::upgrade);
        let writers = publishers.map(|publisher| Arc::clone(&publisher.writer));
        let writers: Vec<_> = answers.into_iter().chain(writers).collect();
        for writer in &writers {
            if !writer.flush(deadline.saturating_duration_since(Instant::now())) {
                log::warn!("{}: not all messages were delivered", writer.topic());
            }
        }
        // Nodes are removed while their endpoints exist, then the endpoints, the participant last.
        if let Some((task, graph)) = open.graph {
            drop(task);
            if !self.graph.leave(open.transport.id(), &graph) {
                log::debug!(
                    "{}: not all readers have acknowledged the empty node list",
                    graph.topic()
                );
            }
            graph.close();
        }
        for writer in writers {
            writer.close();
        }
        self.publishing.stop();
        drop(open.servers);
        drop(open.transport);
    }
}

/// Opens the participant or session of the process, on the transport given by the environment.
fn join(network: &Network, enclave: &Enclave) -> Result<Arc<dyn Transport>, RuntimeError> {
    match network.transport {
        TransportKind::Dds => Ok(Arc::new(Cyclone::join(network, enclave)?)),
        #[cfg(feature = "zenoh")]
        TransportKind::Zenoh => Ok(Arc::new(Zenoh::open(network, enclave)?)),
    }
}

/// Deadline of a shutdown that begins now.
pub(crate) fn deadline() -> Instant {
    let now = Instant::now();
    now.checked_add(DRAIN_TIME).unwrap_or(now)
}

impl Drop for Shared {
    fn drop(&mut self) {
        self.close();
    }
}
