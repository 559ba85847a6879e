//! The DDS reader of a subscription, which comes and goes.
//!
//! A reader must not be there when a publisher of the same topic is made in the same process (see
//! `dds::barrier`): it is closed before, and made again once discovery knows the publisher.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, Weak};
use std::time::Duration;

use smol::Timer;
use smol::channel::{Receiver, Sender, bounded};
use smol::future::or;

use super::core::Core;
use super::dds::barrier::Wait;
use super::dds::reader::DdsReader;
use super::error::RuntimeError;
use super::graph::{EndpointKind, Membership, NodeId};
use super::names;
use super::peers::Peers;
use super::qos::Qos;
use super::subscription::Stats;
use super::sync::lock;

/// A task that runs closes its reader at once.
const PATIENCE: Duration = Duration::from_secs(1);

/// Orders to the task of a subscription. It drops the sender of an order that is carried out.
pub(crate) enum Command {
    /// Take samples from this reader.
    Use(Box<DdsReader>),
    /// Close the reader.
    Close(Sender<()>),
    /// Give the handler everything that waits in this process.
    WorkOff(Sender<()>),
}

/// How to make the reader of a subscription.
pub(crate) struct ReaderPort {
    pub node: NodeId,
    pub topic: String,
    pub type_name: &'static str,
    pub qos: Qos,
    pub max_bytes: usize,
    pub peers: Arc<Peers>,
    pub stats: Arc<Stats>,
    pub commands: Sender<Command>,
    pub is_open: AtomicBool,
    pub graph: Mutex<Option<Membership>>,
}

impl ReaderPort {
    /// Makes the reader and gives it to the task.
    fn open(&self, core: &Core) -> Result<(), RuntimeError> {
        let topic = names::dds_topic(&self.topic);
        let reader = core.dds_reader(
            &self.topic,
            topic,
            self.type_name,
            &self.qos,
            self.max_bytes,
        )?;
        let guid = reader.guid();
        self.is_open.store(true, Relaxed);
        // Fails only if the subscription has ended.
        let _ = self.commands.try_send(Command::Use(Box::new(reader)));
        core.endpoints.register(guid, &self.peers);
        let membership = core.graph.join(self.node, EndpointKind::Reader, guid);
        lock(&self.graph).replace(membership);
        Ok(())
    }

    /// Gives the task an order; the receiver ends when it is carried out. `None`: the task has ended.
    pub(crate) fn order(&self, order: fn(Sender<()>) -> Command) -> Option<Receiver<()>> {
        let (done, carried_out) = bounded(1);
        self.commands.try_send(order(done)).ok()?;
        Some(carried_out)
    }

    /// Has the task close the reader, and waits for that.
    fn close(&self) {
        let Some(closed) = self.order(Command::Close) else {
            return;
        };
        let closed = wait_for(&closed, PATIENCE);
        if !closed {
            log::warn!(
                "{}: a publisher was made while the subscription of this process was busy; make \
                 publishers outside handlers, timers and callbacks",
                self.topic
            );
        }
        self.is_open.store(false, Relaxed);
        lock(&self.graph).take();
        self.peers.remove(|_| true);
    }
}

/// Waits until all senders of a channel are dropped. False: not in time.
pub(crate) fn wait_for(dropped: &Receiver<()>, patience: Duration) -> bool {
    let late = async {
        Timer::after(patience).await;
        false
    };
    smol::block_on(or(async { dropped.recv().await.is_err() }, late))
}

impl Core {
    /// Opens the reader now, or, where this process publishes the topic too, when that is safe.
    pub(crate) fn open_port(self: &Arc<Self>, port: &Arc<ReaderPort>) -> Result<(), RuntimeError> {
        let order = lock(&self.writer_order);
        if self.bus.topic(&port.topic).has_publishers() {
            drop(order);
            self.open_later(vec![Arc::downgrade(port)]);
            return Ok(());
        }
        port.open(self)
    }

    /// Makes a writer while no reader of the topic is open.
    pub(crate) fn with_readers_closed<T>(
        self: &Arc<Self>,
        topic: &str,
        make: impl FnOnce() -> Result<T, RuntimeError>,
    ) -> Result<T, RuntimeError> {
        let order = lock(&self.writer_order);
        self.writers_made.fetch_add(1, Relaxed);
        let ports: Vec<_> = self
            .ports()
            .into_iter()
            .filter(|port| port.topic == topic && port.is_open.load(Relaxed))
            .collect();
        for port in &ports {
            port.close();
        }
        let made = make();
        drop(order);
        if !ports.is_empty() {
            self.open_later(ports.iter().map(Arc::downgrade).collect());
        }
        made
    }

    fn open_later(self: &Arc<Self>, ports: Vec<Weak<ReaderPort>>) {
        let core = Arc::downgrade(self);
        let task = self.io.spawn(async move {
            // Again if a writer was made meanwhile.
            while let Some((writers_made, wait)) = begin_wait(&core) {
                wait.end().await;
                if open_all(&core, &ports, writers_made) {
                    return;
                }
            }
        });
        if let Some(task) = task {
            task.detach();
        }
    }
}

/// A wait for the writers made so far. `None` after shutdown.
fn begin_wait(core: &Weak<Core>) -> Option<(u64, Wait)> {
    let core = core.upgrade()?;
    let writers_made = core.writers_made.load(Relaxed);
    let wait = core.begin_wait()?;
    Some((writers_made, wait))
}

/// Opens readers unless a writer was made since. True: no more to do.
fn open_all(core: &Weak<Core>, ports: &[Weak<ReaderPort>], writers_made: u64) -> bool {
    let Some(core) = core.upgrade() else {
        return true;
    };
    // Whoever makes a writer may be waiting for this very thread.
    let Ok(_order) = core.writer_order.try_lock() else {
        return false;
    };
    if core.writers_made.load(Relaxed) != writers_made {
        return false;
    }
    for port in ports.iter().filter_map(Weak::upgrade) {
        if !port.is_open.load(Relaxed)
            && let Err(error) = port.open(&core)
        {
            log::error!("{error}");
        }
    }
    true
}
