//! The DDS participant of the process and its endpoints.

use std::ffi::CString;
use std::ptr;
use std::sync::Arc;

use futures::StreamExt;
use futures::stream::BoxStream;
use lattice_cyclone_sys::{dds_create_participant, lattice_topic};
use lattice_msgs::rmw_dds_common::ParticipantEntitiesInfo;
use lattice_msgs::{RosMessage, dds_type_name, hash_of};
use smol::channel::{Receiver, Sender, unbounded};

use super::discovery::Discovery;
use super::domain::Domain;
use super::endpoint::{Description, Side};
use super::entity::Entity;
use super::log::explained;
use super::names;
use super::qos::NativeQos;
use super::reader::CycloneReader;
use super::security::properties;
use super::writer::CycloneWriter;
use crate::config::env::Network;
use crate::config::security::{Enclave, SecurityError};
use crate::error::RuntimeError;
use crate::transport::port::{
    ClientEnds, EndpointId, GRAPH_TOPIC, PortEvent, PortService, PortTopic, SampleReader,
    SampleWriter, ServerEnds, ServiceForm, ServiceQos, Transport,
};
use crate::transport::qos::Qos;
use crate::transport::remote::is_type_hash;

/// Longest accepted message of `ros_discovery_info`, bytes.
const MAX_GRAPH_BYTES: usize = 1 << 20;

/// QoS of the `ros_discovery_info` reader: keeps the messages of up to 100 participants.
const GRAPH_READER: Qos = Qos::latched(100);
/// QoS of the `ros_discovery_info` writer: the last message lists all nodes.
const GRAPH_WRITER: Qos = Qos::latched(1);

/// DDS topic of an endpoint.
#[derive(Clone, Copy)]
struct DdsTopic<'a> {
    /// ROS topic or service, for messages.
    name: &'a str,
    dds_name: &'a str,
    ros_type: &'a str,
    /// Type hash, if it may differ from the hash of our message with this name.
    type_hash: Option<&'a str>,
}

/// Topic with an unmangled name.
const GRAPH: DdsTopic<'static> = DdsTopic {
    name: GRAPH_TOPIC,
    dds_name: GRAPH_TOPIC,
    ros_type: <ParticipantEntitiesInfo as RosMessage>::TYPE,
    type_hash: None,
};

/// Cyclone participant of the process.
pub(crate) struct Cyclone {
    // Field order is drop order: inner entities first.
    discovery: Arc<Discovery>,
    participant: Entity,
    _domain: Domain,
    id: EndpointId,
    sender: Sender<PortEvent>,
    events: Receiver<PortEvent>,
}

impl Cyclone {
    /// Joins the domain of the network.
    pub(crate) fn join(network: &Network, enclave: &Enclave) -> Result<Self, RuntimeError> {
        let failed = |reason| RuntimeError::Participant {
            domain: network.domain_id,
            reason,
        };
        let domain = Domain::join(network).map_err(failed)?;
        let made = Self::in_domain(domain, enclave);
        made.map_err(|reason| match &enclave.secrets {
            None => failed(reason),
            Some(secrets) => RuntimeError::Security(SecurityError::Refused {
                enclave: secrets.folder().to_owned(),
                reason,
            }),
        })
    }

    fn in_domain(domain: Domain, enclave: &Enclave) -> Result<Self, String> {
        let properties = enclave.secrets.as_ref().map(properties).transpose()?;
        let user_data = format!("enclave={};", enclave.name);
        let qos = NativeQos::of_participant(&user_data, &properties.unwrap_or_default());
        // SAFETY: a number, and a live QoS that is copied; no listener.
        let make = || unsafe { dds_create_participant(domain.id(), qos.as_ptr(), ptr::null()) };
        let participant = explained(make)?;
        let (sender, events) = unbounded();
        Ok(Self {
            discovery: Discovery::start(&participant, sender.clone(), enclave.secrets.is_some())?,
            id: participant.id()?,
            participant,
            _domain: domain,
            sender,
            events,
        })
    }

    fn topic(&self, name: &str, dds_type: &str) -> Result<Entity, String> {
        let text = |text: &str| CString::new(text).map_err(|_| "a name has a zero byte".to_owned());
        let (name, dds_type) = (text(name)?, text(dds_type)?);
        let parent = self.participant.handle();
        // SAFETY: a handle, and NUL-terminated strings that are copied.
        explained(|| unsafe { lattice_topic(parent, name.as_ptr(), dds_type.as_ptr()) })
    }

    /// Creates topic, QoS and description of an endpoint.
    fn prepare(
        &self,
        of: DdsTopic<'_>,
        qos: &Qos,
        side: Side,
    ) -> Result<(Entity, NativeQos, Description), RuntimeError> {
        let dds_type = dds_type_name(of.ros_type).ok_or_else(|| RuntimeError::TypeName {
            topic: of.name.to_owned(),
            type_name: of.ros_type.to_owned(),
        })?;
        let topic = self.topic(of.dds_name, &dds_type);
        let topic = topic.map_err(|reason| failed(of, side, reason))?;
        let description = Description {
            side,
            dds_name: of.dds_name.to_owned(),
            dds_type,
            qos: *qos,
        };
        let native = NativeQos::of_endpoint(qos, &user_data(of));
        Ok((topic, native, description))
    }

    fn dds_writer(
        &self,
        of: DdsTopic<'_>,
        qos: &Qos,
        keeps: bool,
    ) -> Result<Arc<dyn SampleWriter>, RuntimeError> {
        let (topic, native, description) = self.prepare(of, qos, Side::Writer)?;
        let (parent, events) = (&self.participant, self.sender.clone());
        let writer = CycloneWriter::new(parent, topic, (&native, keeps), description, events);
        let writer = writer.map_err(|reason| failed(of, Side::Writer, reason))?;
        self.discovery.announce(parent, writer.endpoint());
        Ok(Arc::new(writer))
    }

    fn dds_reader(
        &self,
        of: DdsTopic<'_>,
        qos: &Qos,
        max_bytes: usize,
    ) -> Result<Box<dyn SampleReader>, RuntimeError> {
        let (topic, native, description) = self.prepare(of, qos, Side::Reader)?;
        let (parent, events) = (&self.participant, self.sender.clone());
        let reader = CycloneReader::new(parent, topic, &native, max_bytes, description, events);
        let reader = reader.map_err(|reason| failed(of, Side::Reader, reason))?;
        self.discovery.announce(parent, reader.endpoint());
        Ok(Box::new(reader))
    }
}

fn topic<'a>(of: PortTopic<'a>, dds_name: &'a str) -> DdsTopic<'a> {
    DdsTopic {
        name: of.name,
        dds_name,
        ros_type: of.ros_type,
        type_hash: of.type_hash,
    }
}

/// DDS topic of a service's requests or replies.
fn part<'a>(of: PortService<'a>, dds_name: &'a str, ros_type: &'a str) -> DdsTopic<'a> {
    DdsTopic {
        name: of.name,
        dds_name,
        ros_type,
        type_hash: None,
    }
}

/// USER_DATA of an endpoint in the format of rmw_dds_common; empty if the type hash is unknown.
fn user_data(of: DdsTopic<'_>) -> String {
    let hash = of.type_hash.filter(|text| is_type_hash(text));
    let hash = hash.or_else(|| hash_of(of.ros_type));
    hash.map_or_else(String::new, |hash| format!("typehash={hash};"))
}

impl Transport for Cyclone {
    fn id(&self) -> EndpointId {
        self.id
    }

    fn graph_writer(&self) -> Option<Result<Arc<dyn SampleWriter>, RuntimeError>> {
        Some(self.dds_writer(GRAPH, &GRAPH_WRITER, false))
    }

    fn graph_reader(&self) -> Option<Result<Box<dyn SampleReader>, RuntimeError>> {
        Some(self.dds_reader(GRAPH, &GRAPH_READER, MAX_GRAPH_BYTES))
    }

    fn writer(
        &self,
        of: PortTopic<'_>,
        qos: &Qos,
        keeps: bool,
    ) -> Result<Arc<dyn SampleWriter>, RuntimeError> {
        self.dds_writer(topic(of, &names::topic(of.name)), qos, keeps)
    }

    fn reader(
        &self,
        of: PortTopic<'_>,
        qos: &Qos,
        max_bytes: usize,
    ) -> Result<Box<dyn SampleReader>, RuntimeError> {
        self.dds_reader(topic(of, &names::topic(of.name)), qos, max_bytes)
    }

    fn server(&self, of: PortService<'_>, qos: &ServiceQos) -> Result<ServerEnds, RuntimeError> {
        let (requests, replies) = (names::request(of.name), names::reply(of.name));
        let requests = part(of, &requests, of.request);
        let requests = self.dds_reader(requests, &qos.reader, qos.max_bytes)?;
        Ok(ServerEnds {
            form: ServiceForm::Topics,
            requests,
            replies: self.dds_writer(part(of, &replies, of.response), &qos.writer, false)?,
        })
    }

    fn client(&self, of: PortService<'_>, qos: &ServiceQos) -> Result<ClientEnds, RuntimeError> {
        let (requests, answers) = (names::request(of.name), names::reply(of.name));
        let answers = part(of, &answers, of.response);
        let answers = self.dds_reader(answers, &qos.reader, qos.max_bytes)?;
        Ok(ClientEnds {
            form: ServiceForm::Topics,
            requests: self.dds_writer(part(of, &requests, of.request), &qos.writer, false)?,
            answers,
        })
    }

    fn events(&self) -> BoxStream<'static, PortEvent> {
        self.events.clone().boxed()
    }

    fn unauthenticated_participants(&self) -> usize {
        self.discovery.unauthenticated_participants()
    }
}

fn failed(of: DdsTopic<'_>, side: Side, reason: String) -> RuntimeError {
    RuntimeError::Endpoint {
        topic: of.name.to_owned(),
        endpoint: match side {
            Side::Writer => "publisher",
            Side::Reader => "subscription",
        },
        reason,
    }
}
