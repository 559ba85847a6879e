//! Order of writers and readers of one topic in the process: readers are closed while a writer is
//! made, and made again when discovery knows it.

use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Weak};

use futures::future::BoxFuture;

use super::Shared;
use crate::error::RuntimeError;
use crate::names;
use crate::port::{EndpointKind, PortTopic};
use crate::subscription::Intake;
use crate::sync::lock;

impl Shared {
    /// Opens the reader now, or, where this process publishes the topic too, when that is safe.
    pub(crate) fn open_intake(self: &Arc<Self>, intake: &Arc<Intake>) -> Result<(), RuntimeError> {
        let order = lock(&self.writer_order);
        if self.pairs_own_endpoints() && self.bus.topic(&intake.topic).has_publishers() {
            drop(order);
            self.open_later(vec![Arc::downgrade(intake)]);
            return Ok(());
        }
        self.open_reader(intake)
    }

    /// Makes the reader and gives it to the task.
    fn open_reader(&self, intake: &Intake) -> Result<(), RuntimeError> {
        let dds_name = names::dds_topic(&intake.topic);
        let topic = PortTopic {
            name: &intake.topic,
            dds_name: &dds_name,
            ros_type: &intake.type_name,
            type_hash: None,
        };
        let reader = self.reader(topic, &intake.qos, intake.max_bytes)?;
        let id = reader.id();
        let kind = EndpointKind::Reader;
        let graph = self.graph.join(intake.node, kind, (id, &dds_name));
        intake.open(reader, graph);
        self.endpoints.register(id, &intake.peers);
        Ok(())
    }

    /// Makes a writer while no reader of the topic is open.
    pub(crate) fn with_readers_closed<T>(
        self: &Arc<Self>,
        topic: &str,
        make: impl FnOnce() -> Result<T, RuntimeError>,
    ) -> Result<T, RuntimeError> {
        if !self.pairs_own_endpoints() {
            return make();
        }
        let order = lock(&self.writer_order);
        self.writers_made.fetch_add(1, Relaxed);
        let intakes: Vec<_> = self
            .intakes()
            .into_iter()
            .filter(|intake| intake.topic == topic && intake.is_open.load(Relaxed))
            .collect();
        for intake in &intakes {
            intake.close();
        }
        let made = make();
        drop(order);
        if !intakes.is_empty() {
            self.open_later(intakes.iter().map(Arc::downgrade).collect());
        }
        made
    }

    fn open_later(self: &Arc<Self>, intakes: Vec<Weak<Intake>>) {
        let shared = Arc::downgrade(self);
        let task = self.io.spawn(async move {
            // Again if a writer was made meanwhile.
            while let Some((writers_made, wait)) = begin_wait(&shared) {
                wait.await;
                if open_all(&shared, &intakes, writers_made) {
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
pub(super) fn begin_wait(shared: &Weak<Shared>) -> Option<(u64, BoxFuture<'static, ()>)> {
    let shared = shared.upgrade()?;
    let writers_made = shared.writers_made.load(Relaxed);
    let wait = shared.writers_known()?;
    Some((writers_made, wait))
}

/// Opens readers unless a writer was made since. True: no more to do.
fn open_all(shared: &Weak<Shared>, intakes: &[Weak<Intake>], writers_made: u64) -> bool {
    let Some(shared) = shared.upgrade() else {
        return true;
    };
    // Whoever makes a writer may be waiting for this very thread.
    let Ok(_order) = shared.writer_order.try_lock() else {
        return false;
    };
    if shared.writers_made.load(Relaxed) != writers_made {
        return false;
    }
    for intake in intakes.iter().filter_map(Weak::upgrade) {
        if !intake.is_open.load(Relaxed)
            && let Err(error) = shared.open_reader(&intake)
        {
            log::error!("{error}");
        }
    }
    true
}
