//! The participant of the process, and the endpoints made in it.

use std::net::Ipv4Addr;

use lattice_msgs::dds_type_name;
use ros2_client::Context;
use rustdds::no_key::SimpleDataReader;
use rustdds::policy::{Durability, History, ResourceLimits};
use rustdds::{
    DomainParticipant, DomainParticipantBuilder, Duration, QosPolicies, QosPolicyBuilder, Topic,
    TopicKind,
};

use super::payload::{PayloadDeserializer, Taken};
use super::writer::RawWriter;
use crate::error::RuntimeError;
use crate::qos::{Durability as RosDurability, Qos, Reliability};

/// Asked of every socket, in bytes.
const RECEIVE_BUFFER_BYTES: usize = 32 << 20;

/// Part of the QoS that is announced. How long we wait is decided by the publisher thread.
const MAX_BLOCKING_TIME: Duration = Duration::from_millis(100);

/// The DDS participant.
pub(crate) struct Dds {
    // Owns the participant for ros2-client; no ros2-client node, whose spinner subscribes to /clock
    // with a wrong type and takes the status events that we need.
    _context: Context,
    participant: DomainParticipant,
    publisher: rustdds::Publisher,
    subscriber: rustdds::Subscriber,
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
        let context =
            Context::from_domain_participant(participant.clone()).map_err(|e| failed(&e))?;
        let none = QosPolicies::qos_none();
        let publisher = participant
            .create_publisher(&none)
            .map_err(|e| failed(&e))?;
        let subscriber = participant
            .create_subscriber(&none)
            .map_err(|e| failed(&e))?;
        Ok(Self {
            _context: context,
            participant,
            publisher,
            subscriber,
        })
    }

    pub(crate) fn participant(&self) -> &DomainParticipant {
        &self.participant
    }

    /// A writer on `dds_topic`; `name` is for messages.
    pub(crate) fn writer(
        &self,
        name: &str,
        dds_topic: String,
        ros_type: &str,
        qos: &Qos,
    ) -> Result<RawWriter, RuntimeError> {
        let topic = self.topic(name, dds_topic, ros_type, qos, "publisher")?;
        self.publisher
            .create_datawriter_no_key(&topic, None)
            .map_err(|error| endpoint_error(name, "publisher", &error))
    }

    /// A reader on `dds_topic`; `name` is for messages.
    pub(crate) fn reader(
        &self,
        name: &str,
        dds_topic: String,
        ros_type: &str,
        qos: &Qos,
    ) -> Result<SimpleDataReader<Taken, PayloadDeserializer>, RuntimeError> {
        let topic = self.topic(name, dds_topic, ros_type, qos, "subscription")?;
        self.subscriber
            .create_simple_datareader_no_key(&topic, None)
            .map_err(|error| endpoint_error(name, "subscription", &error))
    }

    fn topic(
        &self,
        name: &str,
        dds_topic: String,
        ros_type: &str,
        qos: &Qos,
        endpoint: &'static str,
    ) -> Result<Topic, RuntimeError> {
        let type_name = dds_type_name(ros_type).ok_or_else(|| RuntimeError::TypeName {
            topic: name.to_owned(),
            type_name: ros_type.to_owned(),
        })?;
        self.participant
            .create_topic(dds_topic, type_name, &policies(qos), TopicKind::NoKey)
            .map_err(|error| endpoint_error(name, endpoint, &error))
    }
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

/// Bytes that a receiving socket really gets, as the kernel tells. `None` if it does not.
pub(crate) fn effective_receive_buffer() -> Option<usize> {
    use socket2::{Domain, Socket, Type};
    let socket = Socket::new(Domain::IPV4, Type::DGRAM, None).ok()?;
    // The kernel grants what it may without an error.
    socket.set_recv_buffer_size(RECEIVE_BUFFER_BYTES).ok()?;
    socket.recv_buffer_size().ok()
}
