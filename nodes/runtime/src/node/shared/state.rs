//! Participant, threads and endpoints of a process.

use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::AtomicI64;
use std::sync::{Arc, Mutex, Weak};
use std::thread::JoinHandle;

use smol::Task;
use smol::channel::Sender;

use super::receive_buffer::ReceiveBuffer;
use crate::activity::Activity;
use crate::communication::publisher::PublisherParts;
use crate::communication::service::{Answers, LocalServices, Server, Unanswered};
use crate::communication::subscription::{Intake, Stats, Subscription};
use crate::error::RuntimeError;
use crate::graph::endpoints::Endpoints;
use crate::graph::local_graph::Graph;
use crate::node::diagnostics::Tasks;
use crate::shutdown::Shutdown;
use crate::task_thread::TaskThread;
use crate::transport::local_bus::LocalBus;
use crate::transport::outbox::Outbox;
use crate::transport::port::Transport;

/// The participant, threads and local bus of a process.
pub(crate) struct Shared {
    pub bus: LocalBus,
    pub shutdown: Shutdown,
    pub activity: Activity,
    pub io: TaskThread,
    pub tasks: Arc<Tasks>,
    pub receive_buffer: ReceiveBuffer,
    /// Largest count of each loss so far.
    pub(super) losses: Mutex<BTreeMap<String, u64>>,
    /// Simulated time, shared by all nodes of a process.
    pub(super) sim_time: Mutex<Option<(Arc<AtomicI64>, Subscription)>>,
    pub(super) publishing: TaskThread,
    pub(super) answers: Answers,
    pub(super) services: LocalServices,
    pub(super) endpoints: Arc<Endpoints>,
    pub graph: Arc<Graph>,
    pub(super) open: Mutex<Option<Open>>,
}

/// State released at shutdown.
pub(super) struct Open {
    pub(super) transport: Arc<dyn Transport>,
    pub(super) _watch: Option<Task<()>>,
    pub(super) publishers: Vec<Weak<PublisherParts>>,
    pub(super) intakes: Vec<Weak<Intake>>,
    /// Topics and counters of subscriptions, ended ones included.
    pub(super) subscribed: VecDeque<(String, Arc<Stats>)>,
    pub(super) readers: Vec<(Sender<()>, JoinHandle<()>)>,
    pub(super) servers: Vec<Server>,
    pub(super) unanswered: Vec<Weak<Unanswered>>,
    pub(super) graph: Option<(Task<()>, Arc<Outbox>)>,
    pub(super) graph_of_others: Option<Task<()>>,
}

pub(super) fn closed(topic: &str) -> RuntimeError {
    RuntimeError::Closed {
        topic: topic.to_owned(),
    }
}
