//! The transport over RustDDS. All that names a RustDDS type is here.

mod addresses;
mod events;
mod goodbye;
mod health;
mod large_call;
mod lives;
mod participant;
mod payload;
mod probe;
mod reader;
mod supervisor;
mod wire;
mod writer;

pub(crate) use participant::effective_receive_buffer;

use std::sync::Arc;
use std::time::Instant;

use futures::StreamExt;
use futures::future::BoxFuture;
use futures::stream::BoxStream;
use rustdds::rpc::SampleIdentity;
use rustdds::{GUID, SequenceNumber};
use smol::Timer;
use smol::channel::{Receiver, bounded};

use self::lives::Lives;
use self::participant::Recipe;
use self::supervisor::Supervisor;
use super::error::RuntimeError;
use super::port::{
    EndpointId, PortEvent, PortTopic, SampleId, SampleReader, SampleWriter, Transport,
};
use super::qos::Qos;
use super::shutdown::Shutdown;
use super::task_thread::TaskThread;

/// Events that wait for whoever hears them, at most; the supervisor waits then.
const MAX_EVENTS: usize = 2048;

/// The DDS participant of a process: made anew, with its endpoints, when it no longer works.
pub(crate) struct Dds {
    lives: Arc<Lives>,
    /// Each with the time at which it is passed on.
    events: Receiver<(Instant, PortEvent)>,
    _thread: TaskThread,
}

impl Dds {
    /// Joins a domain, on the loopback interface only if asked.
    pub(crate) fn join(
        domain: u16,
        localhost_only: bool,
        shutdown: &Shutdown,
    ) -> Result<Self, RuntimeError> {
        let lives = Arc::new(Lives::begin(domain, localhost_only)?);
        let thread = TaskThread::start("supervisor", shutdown.clone())?;
        let (sender, events) = bounded(MAX_EVENTS);
        let supervisor = Supervisor::new(Arc::clone(&lives), sender);
        let listening = thread.spawn(Arc::clone(lives.addresses()).listen());
        let tasks = thread.spawn(supervisor.run()).into_iter().chain(listening);
        tasks.for_each(smol::Task::detach);
        Ok(Self {
            lives,
            events,
            _thread: thread,
        })
    }
}

impl Transport for Dds {
    fn id(&self) -> EndpointId {
        self.lives.id()
    }

    fn wire_id(&self, id: EndpointId) -> EndpointId {
        self.lives.wire_id(id)
    }

    fn renewals(&self) -> u64 {
        self.lives.renewals()
    }

    fn writer(
        &self,
        topic: PortTopic<'_>,
        qos: &Qos,
    ) -> Result<Arc<dyn SampleWriter>, RuntimeError> {
        Ok(self.lives.writer(Recipe::new(topic, qos))?)
    }

    fn reader(
        &self,
        of: PortTopic<'_>,
        qos: &Qos,
        max_bytes: usize,
    ) -> Result<Box<dyn SampleReader>, RuntimeError> {
        let reader = self.lives.reader(Recipe::new(of, qos), max_bytes)?;
        Ok(Box::new(reader))
    }

    fn events(&self) -> BoxStream<'static, PortEvent> {
        let events = self.events.clone().then(|(due, event)| async move {
            Timer::at(due).await;
            event
        });
        events.boxed()
    }

    fn pairs_own_endpoints(&self) -> bool {
        true
    }

    fn writers_known(&self) -> Result<BoxFuture<'static, ()>, RuntimeError> {
        let lives = Arc::clone(&self.lives);
        let mut renewals = lives.renewals();
        let (_, mut wait) = lives.writers_known()?;
        Ok(Box::pin(async move {
            loop {
                wait.await;
                // Again if the participant was made anew meanwhile.
                let before = std::mem::replace(&mut renewals, lives.renewals());
                match lives.writers_known() {
                    Ok((_, again)) if renewals != before => wait = again,
                    _ => return,
                }
            }
        }))
    }
}

fn endpoint_id(guid: GUID) -> EndpointId {
    EndpointId(guid.to_bytes())
}

fn sample_id(identity: SampleIdentity) -> SampleId {
    SampleId {
        writer: endpoint_id(identity.writer_guid),
        number: identity.sequence_number.into(),
    }
}

fn sample_identity(id: SampleId) -> SampleIdentity {
    SampleIdentity {
        writer_guid: GUID::from_bytes(id.writer.0),
        sequence_number: SequenceNumber::from(id.number),
    }
}
