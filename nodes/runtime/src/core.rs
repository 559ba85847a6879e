//! The parts that the nodes of a process share: the participant, the threads, the local bus.

use std::sync::atomic::{AtomicBool, AtomicU64};
use std::sync::{Arc, Mutex, Weak};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use lattice_msgs::RosMessage;
use rustdds::RTPSEntity;
use smol::Task;
use smol::channel::{Sender, bounded, unbounded};

use super::clock::SimTime;
use super::dds::barrier::{Barrier, Wait};
use super::dds::events::Endpoints;
use super::dds::participant::Dds;
use super::dds::reader::DdsReader;
use super::dds::writer::{DdsWriter, WhenFull};
use super::diagnostics::Tasks;
use super::error::RuntimeError;
use super::graph::{self, EndpointKind, Graph, NodeId};
use super::local_bus::{LocalBus, Membership};
use super::names;
use super::peers::Peers;
use super::publisher;
use super::qos::{Durability, Qos};
use super::reader_port::{Command, ReaderPort, wait_for};
use super::service::{Answers, Server};
use super::shutdown::Shutdown;
use super::subscription::{Load, Running, Sample, Source, Stats, Subscription, spawn_reader};
use super::sync::lock;
use super::transport_status::ReceiveBuffer;
use super::worker::Worker;

/// Messages that wait in the queue of one publisher, at most.
const QUEUE_MESSAGES: usize = 1024;

/// Bytes that wait in the queue of one publisher, at most.
const QUEUE_BYTES: usize = 128 << 20;

/// Small messages of a publisher in this process that wait for a subscription, at least. They are
/// shared, not copied, and the handler that they wait for returns at once.
const LOCAL_SMALL_MESSAGES: usize = 1024;

/// The same for large ones: several bursts of line scans, and not too much of 4 MB clouds.
const LOCAL_LARGE_MESSAGES: usize = 128;

/// Time for each of three at the end: handlers, answers, and what is queued to be sent.
const DRAIN_TIME: Duration = Duration::from_secs(2);

/// Length of a message that is accepted unless a parameter says otherwise.
pub(crate) const DEFAULT_MAX_MESSAGE_BYTES: usize = 64 << 20;

pub(crate) struct Core {
    pub bus: LocalBus,
    pub shutdown: Shutdown,
    pub io: Worker,
    pub tasks: Arc<Tasks>,
    pub receive_buffer: ReceiveBuffer,
    pub sim_time: Mutex<Option<SimTime>>,
    publishing: Worker,
    pub answers: Answers,
    pub endpoints: Arc<Endpoints>,
    pub graph: Arc<Graph>,
    /// Held while a writer is made, or a reader that a writer must not meet.
    pub writer_order: Mutex<()>,
    pub writers_made: AtomicU64,
    open: Mutex<Option<Open>>,
}

/// Gone after shutdown.
struct Open {
    dds: Dds,
    _watch: Option<Task<()>>,
    publishers: Vec<Weak<publisher::Core>>,
    ports: Vec<Weak<ReaderPort>>,
    barrier: Barrier,
    readers: Vec<(Sender<()>, JoinHandle<()>)>,
    servers: Vec<Server>,
    graph: Option<Task<()>>,
}

impl Core {
    pub(crate) fn start(domain: u16, localhost_only: bool) -> Result<Arc<Self>, RuntimeError> {
        let shutdown = Shutdown::default();
        let io = Worker::start("io", shutdown.clone())?;
        let publishing = Worker::start("publisher", shutdown.clone())?;
        let dds = Dds::join(domain, localhost_only)?;
        let barrier = Barrier::new(&dds)?;
        let endpoints = Arc::new(Endpoints::new(dds.participant()));
        let watch = io.spawn(Arc::clone(&endpoints).watch(dds.participant().clone()));
        let core = Arc::new(Self {
            bus: LocalBus::default(),
            shutdown,
            io,
            tasks: Arc::default(),
            receive_buffer: ReceiveBuffer::probe(),
            sim_time: Mutex::default(),
            publishing,
            answers: Answers::default(),
            endpoints,
            graph: Graph::new(),
            writer_order: Mutex::default(),
            writers_made: AtomicU64::new(0),
            open: Mutex::new(Some(Open {
                dds,
                _watch: watch,
                publishers: Vec::new(),
                ports: Vec::new(),
                barrier,
                readers: Vec::new(),
                servers: Vec::new(),
                graph: None,
            })),
        });
        core.publish_graph()?;
        Ok(core)
    }

    fn publish_graph(&self) -> Result<(), RuntimeError> {
        let (topic, qos) = (graph::TOPIC.to_owned(), Qos::latched(1));
        let writer = self.dds_writer(graph::TOPIC, topic, graph::TYPE, &qos, WhenFull::Wait)?;
        if let Some(open) = lock(&self.open).as_mut() {
            let participant = open.dds.participant().guid();
            open.graph = self
                .io
                .spawn(Arc::clone(&self.graph).publish(participant, writer));
        }
        Ok(())
    }

    /// Keeps servers until shutdown.
    pub(crate) fn keep(&self, servers: Vec<Server>) {
        if let Some(open) = lock(&self.open).as_mut() {
            open.servers.extend(servers);
        }
    }

    pub(crate) fn publisher<M: RosMessage>(
        self: &Arc<Self>,
        node: NodeId,
        topic: &str,
        qos: &Qos,
    ) -> Result<publisher::Publisher<M>, RuntimeError> {
        let core = self.publisher_core(node, topic, M::TYPE, qos, WhenFull::Drop, |peers| {
            let topic = self.bus.topic(topic);
            topic.join_publisher::<M>(peers, latch_depth(qos))
        })?;
        Ok(publisher::Publisher::new(core))
    }

    pub(crate) fn raw_publisher(
        self: &Arc<Self>,
        node: NodeId,
        topic: &str,
        type_name: &str,
        qos: &Qos,
    ) -> Result<publisher::RawPublisher, RuntimeError> {
        let core = self.publisher_core(node, topic, type_name, qos, WhenFull::Wait, |peers| {
            let topic = self.bus.topic(topic);
            topic.join_raw_publisher(type_name, peers, latch_depth(qos))
        })?;
        Ok(publisher::RawPublisher::new(core))
    }

    fn publisher_core(
        self: &Arc<Self>,
        node: NodeId,
        topic: &str,
        type_name: &str,
        qos: &Qos,
        when_full: WhenFull,
        join: impl FnOnce(&Arc<Peers>) -> Result<Membership, RuntimeError>,
    ) -> Result<Arc<publisher::Core>, RuntimeError> {
        let peers = Arc::new(Peers::of_publisher(topic));
        let local = join(&peers)?;
        let writer = self.with_readers_closed(topic, || {
            self.dds_writer(topic, names::dds_topic(topic), type_name, qos, when_full)
        })?;
        let guid = writer.guid();
        let core = Arc::new(publisher::Core {
            writer,
            peers: Arc::clone(&peers),
            local,
            latch: (qos.durability == Durability::TransientLocal)
                .then(|| Mutex::new(publisher::Latch::new(latch_depth(qos)))),
            shutdown: self.shutdown.clone(),
            _graph: self.graph.join(node, EndpointKind::Writer, guid),
        });
        if let Some(open) = lock(&self.open).as_mut() {
            open.publishers.retain(|p| p.strong_count() > 0);
            open.publishers.push(Arc::downgrade(&core));
        }
        let joined = Arc::downgrade(&core);
        peers.on_joined(Box::new(move || {
            if let Some(core) = joined.upgrade() {
                core.peer_joined();
            }
        }));
        self.endpoints.register(guid, &peers);
        Ok(core)
    }

    /// A writer whose queue the publisher thread serves, until the last handle of it goes.
    pub(crate) fn dds_writer(
        &self,
        name: &str,
        dds_topic: String,
        type_name: &str,
        qos: &Qos,
        when_full: WhenFull,
    ) -> Result<Arc<DdsWriter>, RuntimeError> {
        let mut guard = lock(&self.open);
        let open = guard.as_mut().ok_or_else(|| closed(name))?;
        let writer = open.dds.writer(name, dds_topic, type_name, qos)?;
        let (writer, task) = DdsWriter::new(name, writer, when_full, QUEUE_MESSAGES, QUEUE_BYTES);
        self.publishing
            .spawn(task)
            .ok_or_else(|| closed(name))?
            .detach();
        Ok(Arc::new(writer))
    }

    /// A reader of samples up to `max_bytes`.
    pub(crate) fn dds_reader(
        &self,
        name: &str,
        dds_topic: String,
        type_name: &str,
        qos: &Qos,
        max_bytes: usize,
    ) -> Result<DdsReader, RuntimeError> {
        let mut guard = lock(&self.open);
        let open = guard.as_mut().ok_or_else(|| closed(name))?;
        let reader = open.dds.reader(name, dds_topic, type_name, qos)?;
        let reader = DdsReader::new(reader, max_bytes);
        if qos.durability == Durability::Volatile {
            reader.skip_old();
        }
        Ok(reader)
    }

    pub(crate) fn subscribe<M: RosMessage>(
        self: &Arc<Self>,
        node: NodeId,
        topic: &str,
        qos: &Qos,
        load: Load,
        max_bytes: usize,
        mut handler: impl FnMut(Sample<'_, M>, &Arc<Stats>) + Send + 'static,
    ) -> Result<Subscription, RuntimeError> {
        let peers = Arc::new(Peers::of_subscription(topic));
        let stats = Arc::new(Stats::new(Arc::clone(&peers)));
        let (sender, local) = bounded(qos.depth.max(match load {
            Load::Small => LOCAL_SMALL_MESSAGES,
            Load::Large => LOCAL_LARGE_MESSAGES,
        }));
        let latched = qos.durability == Durability::TransientLocal;
        let membership = self.bus.topic(topic).join_subscriber::<M>(
            &peers,
            sender,
            stats.lost_counter(),
            latched,
        )?;
        let (commands, orders) = unbounded();
        let port = Arc::new(ReaderPort {
            node,
            topic: topic.to_owned(),
            type_name: M::TYPE,
            qos: *qos,
            max_bytes,
            peers,
            stats: Arc::clone(&stats),
            commands,
            is_open: AtomicBool::new(false),
            graph: Mutex::default(),
        });
        let source = Source {
            commands: orders,
            local,
            _membership: membership,
            stats: Arc::clone(&stats),
        };
        let task = source.run(move |sample: Sample<'_, M>| handler(sample, &stats));
        let running = match load {
            Load::Small => Running::OnIoThread {
                _task: self.io.spawn(task).ok_or_else(|| closed(topic))?,
            },
            Load::Large => {
                let (stop, thread) = spawn_reader(&self.shutdown, task)?;
                if let Some(open) = lock(&self.open).as_mut() {
                    open.readers.retain(|(_, thread)| !thread.is_finished());
                    open.readers.push((stop.clone(), thread));
                }
                Running::OnOwnThread { _stop: stop }
            }
        };
        if let Some(open) = lock(&self.open).as_mut() {
            open.ports.retain(|port| port.strong_count() > 0);
            open.ports.push(Arc::downgrade(&port));
        }
        self.open_port(&port)?;
        Ok(Subscription::new(port, running))
    }

    /// Publishers that are in use.
    pub(crate) fn publishers(&self) -> Vec<Arc<publisher::Core>> {
        let open = lock(&self.open);
        let all = open.iter().flat_map(|open| &open.publishers);
        all.filter_map(Weak::upgrade).collect()
    }

    /// Subscriptions that are in use.
    pub(crate) fn ports(&self) -> Vec<Arc<ReaderPort>> {
        let open = lock(&self.open);
        let all = open.iter().flat_map(|open| &open.ports);
        all.filter_map(Weak::upgrade).collect()
    }

    /// Begins to wait until discovery knows the writers made so far. `None` after shutdown.
    pub(crate) fn begin_wait(&self) -> Option<Wait> {
        let open = lock(&self.open);
        let open = open.as_ref()?;
        open.barrier.begin(&open.dds, &self.endpoints).ok()
    }

    /// Has all subscriptions give their handlers what waits in this process. Not from a thread of the
    /// runtime.
    pub(crate) fn work_off(&self, deadline: Instant) {
        let orders: Vec<_> = (self.ports().into_iter())
            .filter_map(|port| Some((port.order(Command::WorkOff)?, port)))
            .collect();
        for (order, port) in orders {
            if !wait_for(&order, deadline.saturating_duration_since(Instant::now())) {
                log::warn!("{}: messages of this process were not handled", port.topic);
            }
        }
    }

    /// Ends everything: what waits for handlers and clients first, then timers and readers, then what
    /// is queued goes out, then we leave.
    ///
    /// Not from a thread of the runtime.
    pub(crate) fn close(&self) {
        self.shutdown.request();
        if lock(&self.open).is_some() {
            self.work_off(deadline());
        }
        let answers = self.answers.end(deadline());
        let Some(open) = lock(&self.open).take() else {
            return;
        };
        self.io.stop();
        for (stop, thread) in open.readers {
            stop.close();
            // Its panic has been reported by the thread itself.
            let _ = thread.join();
        }
        let publishers = open.publishers.iter().filter_map(Weak::upgrade);
        let writers = publishers.map(|publisher| Arc::clone(&publisher.writer));
        let deadline = deadline();
        for writer in answers.into_iter().chain(writers) {
            if !writer.flush(deadline.saturating_duration_since(Instant::now())) {
                log::warn!("{}: not everything was delivered", writer.topic());
            }
            writer.close();
        }
        self.publishing.stop();
        drop(open.servers);
        drop(open.dds);
    }
}

/// End of a phase of the shutdown that begins now.
pub(crate) fn deadline() -> Instant {
    let now = Instant::now();
    now.checked_add(DRAIN_TIME).unwrap_or(now)
}

impl Drop for Core {
    fn drop(&mut self) {
        self.close();
    }
}

fn closed(topic: &str) -> RuntimeError {
    RuntimeError::Closed {
        topic: topic.to_owned(),
    }
}

fn latch_depth(qos: &Qos) -> usize {
    match qos.durability {
        Durability::TransientLocal => qos.depth.max(1),
        Durability::Volatile => 0,
    }
}
