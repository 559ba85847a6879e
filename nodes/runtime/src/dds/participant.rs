//! The participant of the process, and the endpoints made in it.

use std::net::Ipv4Addr;
use std::sync::Arc;

use futures::future::BoxFuture;
use futures::stream::BoxStream;
use lattice_msgs::dds_type_name;
use rustdds::policy::{Durability, History, ResourceLimits};
use rustdds::{
    DomainParticipant, DomainParticipantBuilder, Duration, QosPolicies, QosPolicyBuilder,
    RTPSEntity, Topic, TopicKind,
};

use super::probe::Probes;
use super::reader::DdsReader;
use super::writer::{DdsWriter, RawWriter};
use super::{endpoint_id, events};
use crate::error::RuntimeError;
use crate::port::{EndpointId, PortEvent, PortTopic, SampleReader, SampleWriter, Transport};
use crate::qos::{Durability as RosDurability, Qos, Reliability};

/// Asked of every socket, in bytes.
const RECEIVE_BUFFER_BYTES: usize = 32 << 20;

/// Part of the QoS that is announced. How long we wait is decided by the publisher thread.
const MAX_BLOCKING_TIME: Duration = Duration::from_millis(100);

/// Type of the topic of probes, which carries nothing.
const PROBE_TYPE: &str = "std_msgs/msg/Empty";

/// The DDS participant of a process.
pub(crate) struct Dds {
    participant: DomainParticipant,
    publisher: rustdds::Publisher,
    subscriber: rustdds::Subscriber,
    probes: Arc<Probes>,
    /// Name of the topic of probes. It has no ROS prefix, so ROS tools do not show it.
    probe_topic: String,
    _probe_reader: DdsReader,
}

impl Dds {
    /// Joins a domain, on the loopback interface only if asked.
    pub(crate) fn join(domain: u16, localhost_only: bool) -> Result<Self, RuntimeError> {
        let failed = |reason: &dyn std::fmt::Debug| RuntimeError::Participant {
            domain,
            reason: format!("{reason:?}"),
        };
        let mut builder =
            DomainParticipantBuilder::new(domain).socket_receive_buffer_size(RECEIVE_BUFFER_BYTES);
        if localhost_only {
            builder = builder.with_only_networks([Ipv4Addr::LOCALHOST]);
        }
        let participant = builder.build().map_err(|e| failed(&e))?;
        let none = QosPolicies::qos_none();
        let publisher = participant.create_publisher(&none);
        let publisher = publisher.map_err(|e| failed(&e))?;
        let subscriber = participant.create_subscriber(&none);
        let subscriber = subscriber.map_err(|e| failed(&e))?;
        let guid = participant.guid().to_bytes();
        let name: String = guid.iter().map(|byte| format!("{byte:02x}")).collect();
        let probe_topic = format!("lattice_probe_{name}");
        let probes = probe(&probe_topic);
        let reader = reader(&participant, &subscriber, probes, &PROBE_QOS, 0)?;
        Ok(Self {
            participant,
            publisher,
            subscriber,
            probes: Arc::default(),
            probe_topic,
            _probe_reader: reader,
        })
    }

    fn raw_writer(&self, of: PortTopic<'_>, qos: &Qos) -> Result<RawWriter, RuntimeError> {
        let topic = topic(&self.participant, of, qos, "publisher")?;
        self.publisher
            .create_datawriter_no_key(&topic, None)
            .map_err(|error| endpoint_error(of.name, "publisher", &error))
    }
}

impl Transport for Dds {
    fn id(&self) -> EndpointId {
        endpoint_id(self.participant.guid())
    }

    fn writer(
        &self,
        topic: PortTopic<'_>,
        qos: &Qos,
    ) -> Result<Arc<dyn SampleWriter>, RuntimeError> {
        Ok(Arc::new(DdsWriter(self.raw_writer(topic, qos)?)))
    }

    fn reader(
        &self,
        of: PortTopic<'_>,
        qos: &Qos,
        max_bytes: usize,
    ) -> Result<Box<dyn SampleReader>, RuntimeError> {
        let reader = reader(&self.participant, &self.subscriber, of, qos, max_bytes)?;
        if qos.durability == RosDurability::Volatile {
            reader.skip_old();
        }
        Ok(Box::new(reader))
    }

    fn events(&self) -> BoxStream<'static, PortEvent> {
        events::events(&self.participant, Arc::clone(&self.probes))
    }

    fn pairs_own_endpoints(&self) -> bool {
        true
    }

    fn writers_known(&self) -> Result<BoxFuture<'static, ()>, RuntimeError> {
        let writer = self.raw_writer(probe(&self.probe_topic), &PROBE_QOS)?;
        Ok(Box::pin(Arc::clone(&self.probes).wait(writer)))
    }
}

const PROBE_QOS: Qos = Qos::best_effort(1);

fn probe(name: &str) -> PortTopic<'_> {
    PortTopic {
        name,
        dds_name: name,
        ros_type: PROBE_TYPE,
        type_hash: None,
    }
}

fn reader(
    participant: &DomainParticipant,
    subscriber: &rustdds::Subscriber,
    of: PortTopic<'_>,
    qos: &Qos,
    max_bytes: usize,
) -> Result<DdsReader, RuntimeError> {
    let topic = topic(participant, of, qos, "subscription")?;
    let reader = subscriber.create_simple_datareader_no_key(&topic, None);
    let reader = reader.map_err(|error| endpoint_error(of.name, "subscription", &error))?;
    Ok(DdsReader::new(reader, max_bytes))
}

fn topic(
    participant: &DomainParticipant,
    of: PortTopic<'_>,
    qos: &Qos,
    endpoint: &'static str,
) -> Result<Topic, RuntimeError> {
    let type_name = dds_type_name(of.ros_type).ok_or_else(|| RuntimeError::TypeName {
        topic: of.name.to_owned(),
        type_name: of.ros_type.to_owned(),
    })?;
    let dds_name = of.dds_name.to_owned();
    participant
        .create_topic(dds_name, type_name, &policies(qos), TopicKind::NoKey)
        .map_err(|error| endpoint_error(of.name, endpoint, &error))
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
fn policies(qos: &Qos) -> QosPolicies {
    let depth = i32::try_from(qos.depth).unwrap_or(i32::MAX).max(1);
    let builder = QosPolicyBuilder::new()
        .history(History::KeepLast { depth })
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
