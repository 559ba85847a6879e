//! A participant of RustDDS, and the endpoints made in it.

use std::net::Ipv4Addr;
use std::sync::Arc;

use futures::StreamExt;
use futures::future::BoxFuture;
use futures::stream::BoxStream;
use lattice_msgs::dds_type_name;
use rustdds::policy::{Durability, History, ResourceLimits};
use rustdds::{
    DomainParticipant, DomainParticipantBuilder, DomainParticipantStatusEvent, Duration, GUID,
    QosPolicies, QosPolicyBuilder, RTPSEntity, StatusEvented, Topic, TopicKind,
};

use super::endpoint_id;
use super::events::Events;
use super::health::Threads;
use super::lives::Lives;
use super::reader::RawReader;
use super::writer::RawWriter;
use crate::error::RuntimeError;
use crate::port::{EndpointId, PortEvent, PortTopic};
use crate::qos::{Durability as RosDurability, Qos, Reliability};

/// Asked of every socket, in bytes.
const RECEIVE_BUFFER_BYTES: usize = 32 << 20;

/// Part of the QoS that is announced. How long we wait is decided by the publisher thread.
const MAX_BLOCKING_TIME: Duration = Duration::from_millis(100);

/// Type of the topic of probes, which carries nothing.
const PROBE_TYPE: &str = "std_msgs/msg/Empty";

/// A participant of RustDDS. [`Dds`] has one after the other.
///
/// [`Dds`]: super::Dds
pub(super) struct Participant {
    // Goes before what it is in.
    _probe_reader: RawReader,
    guid: GUID,
    participant: DomainParticipant,
    publisher: rustdds::Publisher,
    subscriber: rustdds::Subscriber,
    translator: Events,
    /// Topic of probes. Its name has no ROS prefix, so ROS tools do not show it.
    probe: Recipe,
    threads: Threads,
}

/// Makes a participant whose sockets listen on the loopback interface alone, where the code that can do
/// so, which is unsafe, is built in.
fn on_loopback<T>(make: impl FnOnce() -> T) -> T {
    #[cfg(feature = "cyclone")]
    return crate::confine::to_loopback(make);
    #[cfg(not(feature = "cyclone"))]
    make()
}

impl Participant {
    /// Joins a domain, on the loopback interface only if asked.
    pub(super) fn join(domain: u16, localhost_only: bool) -> Result<Self, RuntimeError> {
        let failed = |reason: &dyn std::fmt::Debug| RuntimeError::Participant {
            domain,
            reason: format!("{reason:?}"),
        };
        let mut builder =
            DomainParticipantBuilder::new(domain).socket_receive_buffer_size(RECEIVE_BUFFER_BYTES);
        if localhost_only {
            builder = builder.with_only_networks([Ipv4Addr::LOCALHOST]);
        }
        let build = || match localhost_only {
            true => on_loopback(|| builder.build()),
            false => builder.build(),
        };
        let (participant, threads) = Threads::of(build);
        let participant = participant.map_err(|e| failed(&e))?;
        let none = QosPolicies::qos_none();
        let publisher = participant.create_publisher(&none);
        let publisher = publisher.map_err(|e| failed(&e))?;
        let subscriber = participant.create_subscriber(&none);
        let subscriber = subscriber.map_err(|e| failed(&e))?;
        let guid = participant.guid();
        let name = format!("lattice_probe_{}", endpoint_id(guid).hex());
        let topic = PortTopic {
            name: &name,
            dds_name: &name,
            ros_type: PROBE_TYPE,
            type_hash: None,
        };
        let probe = Recipe::new(topic, &Qos::best_effort(1));
        let reader = raw_reader(&participant, &subscriber, &probe)?;
        Ok(Self {
            guid,
            participant,
            publisher,
            subscriber,
            translator: Events::of(guid),
            probe,
            _probe_reader: reader,
            threads,
        })
    }

    pub(super) fn id(&self) -> EndpointId {
        endpoint_id(self.guid)
    }

    pub(super) fn writer(&self, of: &Recipe) -> Result<RawWriter, RuntimeError> {
        let history = match of.qos.kept() {
            0 => of.qos.depth,
            kept => kept,
        };
        let topic = topic(&self.participant, of, "publisher", history)?;
        self.publisher
            .create_datawriter_no_key(&topic, None)
            .map_err(|error| endpoint_error(&of.name, "publisher", &error))
    }

    pub(super) fn reader(&self, of: &Recipe) -> Result<RawReader, RuntimeError> {
        raw_reader(&self.participant, &self.subscriber, of)
    }

    /// Status events of the participant, its own endpoints and their matches with each other included.
    pub(super) fn events(&self) -> BoxStream<'static, DomainParticipantStatusEvent> {
        let listener = self.participant.status_listener();
        let events = futures::stream::unfold(listener, |listener| async move {
            let event = listener.as_async_status_stream().next().await?;
            Some((event, listener))
        });
        events.boxed()
    }

    /// The event as one of the port.
    pub(super) fn port_event(
        &self,
        event: DomainParticipantStatusEvent,
        lives: &Lives,
    ) -> Option<PortEvent> {
        self.translator.translate(event, lives)
    }

    /// A wait for discovery to know all writers made so far.
    pub(super) fn writers_known(&self) -> Result<BoxFuture<'static, ()>, RuntimeError> {
        let writer = self.writer(&self.probe)?;
        Ok(Box::pin(Arc::clone(&self.translator.probes).wait(writer)))
    }

    /// True while the threads of RustDDS run.
    pub(super) fn is_alive(&self) -> bool {
        // Fails where the thread of discovery has ended.
        self.threads.all_run() && self.participant.assert_liveliness().is_ok()
    }
}

/// Everything that an endpoint is made from, and made anew from.
#[derive(Clone)]
pub(super) struct Recipe {
    pub name: String,
    dds_name: String,
    ros_type: String,
    pub qos: Qos,
}

impl Recipe {
    pub(super) fn new(topic: PortTopic<'_>, qos: &Qos) -> Self {
        Self {
            name: topic.name.to_owned(),
            dds_name: topic.dds_name.to_owned(),
            ros_type: topic.ros_type.to_owned(),
            qos: *qos,
        }
    }

    pub(super) fn is_ros_topic(&self) -> bool {
        self.dds_name.starts_with("rt/")
    }

    pub(super) fn is_service(&self) -> bool {
        ["rq/", "rr/"]
            .iter()
            .any(|of| self.dds_name.starts_with(of))
    }

    /// Our type as ROS writes it, and `theirs` likewise, if that is another.
    pub(super) fn other_type(&self, theirs: &str) -> Option<(&str, String)> {
        if dds_type_name(&self.ros_type).is_none_or(|ours| ours == theirs) {
            return None;
        }
        let name = theirs.replace("::dds_::", "/").replace("::", "/");
        Some((&self.ros_type, name.trim_end_matches('_').to_owned()))
    }
}

fn raw_reader(
    participant: &DomainParticipant,
    subscriber: &rustdds::Subscriber,
    of: &Recipe,
) -> Result<RawReader, RuntimeError> {
    let topic = topic(participant, of, "subscription", of.qos.depth)?;
    subscriber
        .create_simple_datareader_no_key(&topic, None)
        .map_err(|error| endpoint_error(&of.name, "subscription", &error))
}

fn topic(
    participant: &DomainParticipant,
    of: &Recipe,
    endpoint: &'static str,
    history: usize,
) -> Result<Topic, RuntimeError> {
    let type_name = dds_type_name(&of.ros_type).ok_or_else(|| RuntimeError::TypeName {
        topic: of.name.clone(),
        type_name: of.ros_type.clone(),
    })?;
    let (dds_name, policies) = (of.dds_name.clone(), policies(&of.qos, history));
    participant
        .create_topic(dds_name, type_name, &policies, TopicKind::NoKey)
        .map_err(|error| endpoint_error(&of.name, endpoint, &error))
}

fn endpoint_error(
    topic: &str,
    endpoint: &'static str,
    reason: &dyn std::fmt::Debug,
) -> RuntimeError {
    RuntimeError::Endpoint {
        topic: topic.to_owned(),
        endpoint,
        reason: format!("{reason:?}"),
    }
}

/// The resource limits are what bounds memory: RustDDS keeps 64 samples and more without them.
///
/// `history` is what a writer keeps of what has been acknowledged.
fn policies(qos: &Qos, history: usize) -> QosPolicies {
    let count = |samples: usize| i32::try_from(samples).unwrap_or(i32::MAX).max(1);
    let (depth, history) = (count(qos.depth), count(history));
    let builder = QosPolicyBuilder::new()
        .history(History::KeepLast { depth: history })
        .resource_limits(ResourceLimits {
            max_samples: depth,
            max_instances: 1,
            max_samples_per_instance: depth,
        })
        .durability(match qos.durability {
            RosDurability::Volatile => Durability::Volatile,
            RosDurability::TransientLocal => Durability::TransientLocal,
        });
    match qos.reliability {
        Reliability::Reliable => builder.reliable(MAX_BLOCKING_TIME),
        Reliability::BestEffort => builder.best_effort(),
    }
    .build()
}

/// Receive buffer that the kernel grants a socket, in bytes. `None`: not known.
pub(crate) fn effective_receive_buffer() -> Option<usize> {
    use socket2::{Domain, Socket, Type};
    let socket = Socket::new(Domain::IPV4, Type::DGRAM, None).ok()?;
    // The kernel grants what it may without an error.
    socket.set_recv_buffer_size(RECEIVE_BUFFER_BYTES).ok()?;
    socket.recv_buffer_size().ok()
}
