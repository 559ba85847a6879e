//! The port of the transport: everything that the runtime asks of the network, in terms of no implementation.

use std::borrow::Cow;
use std::future::poll_fn;
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, MutexGuard};
use std::task::{Context, Poll};
use std::time::Duration;

use futures::future::BoxFuture;
use futures::stream::BoxStream;

use super::error::RuntimeError;
use super::qos::Qos;
use super::remote::{GraphRole, RemotePublisher};

/// Buffer of a sample that writers share.
pub(crate) use bytes::Bytes;

/// Length of the encapsulation header in front of every CDR sample.
pub(crate) const ENCAPSULATION_BYTES: usize = 4;

/// Topic of the messages that name the nodes of a process, on DDS.
pub(crate) const GRAPH_TOPIC: &str = "ros_discovery_info";

/// Receive buffer asked of every socket, in bytes.
pub(crate) const RECEIVE_BUFFER_BYTES: usize = 32 << 20;

/// Identity of an endpoint: on DDS its GUID, of which twelve bytes name the participant; on Zenoh its gid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct EndpointId(pub [u8; 16]);

impl EndpointId {
    /// First two bytes, which the vendor of the implementation has been given.
    pub(crate) fn vendor(&self) -> [u8; 2] {
        let [first, second, ..] = self.0;
        [first, second]
    }

    /// All bytes in hexadecimal digits.
    pub(crate) fn hex(&self) -> String {
        self.0.iter().map(|byte| format!("{byte:02x}")).collect()
    }

    /// True for two endpoints of one participant.
    pub(crate) fn same_participant(&self, other: &Self) -> bool {
        self.0.first_chunk::<12>() == other.0.first_chunk()
    }
}

/// Kind of an endpoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum EndpointKind {
    Reader,
    Writer,
}

/// One sample among all samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct SampleId {
    /// The writer that sent it, or what the sender names in its place.
    pub writer: EndpointId,
    /// Its number there; 0 where the sender does not say.
    pub number: i64,
}

/// Origin of a sample that was received.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Origin {
    /// The sample itself.
    pub sample: SampleId,
    /// The request it belongs to, where the sender said so.
    pub related: Option<SampleId>,
}

/// A node of this process.
#[derive(Clone, Debug)]
#[cfg_attr(not(feature = "zenoh"), expect(dead_code, reason = "DDS has no nodes"))]
pub(crate) struct PortNode {
    /// Its number in the process.
    pub number: usize,
    /// Namespace, such as `/` or `/robot`.
    pub namespace: String,
    /// Name in it.
    pub name: String,
}

/// Topic of an endpoint.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(not(feature = "zenoh"), expect(dead_code, reason = "DDS has no nodes"))]
pub(crate) struct PortTopic<'a> {
    /// Node of the endpoint.
    pub node: &'a PortNode,
    /// Full name.
    pub name: &'a str,
    /// Type, such as `sensor_msgs/msg/Imu`.
    pub ros_type: &'a str,
    /// Hash of the type where it may be another than that of our message of this name.
    pub type_hash: Option<&'a str>,
}

/// Service of a server or client.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(not(feature = "zenoh"), expect(dead_code, reason = "DDS has no nodes"))]
pub(crate) struct PortService<'a> {
    /// Node of the endpoint.
    pub node: &'a PortNode,
    /// Full name.
    pub name: &'a str,
    /// Type, such as `std_srvs/srv/Trigger`.
    pub ros_type: &'a str,
    /// Type of the request.
    pub request: &'a str,
    /// Type of the response.
    pub response: &'a str,
}

/// Form of requests and replies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ServiceForm {
    /// Samples of two topics, in the form of the rmw of the peer. A reply is lost to a client whose reader is
    /// not matched yet.
    Topics,
    /// Bare messages; the transport names the request and finds the way back.
    Queries,
}

/// Both ends of a server.
pub(crate) struct ServerEnds {
    pub form: ServiceForm,
    pub requests: Box<dyn SampleReader>,
    /// Each reply names its request.
    pub replies: Arc<dyn SampleWriter>,
}

/// Both ends of a client.
pub(crate) struct ClientEnds {
    pub form: ServiceForm,
    /// A request names itself where the form is [`ServiceForm::Queries`].
    pub requests: Arc<dyn SampleWriter>,
    pub answers: Box<dyn SampleReader>,
}

/// Qualities of both ends of a server or client.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ServiceQos {
    pub reader: Qos,
    pub writer: Qos,
    /// Longest sample that is taken, encapsulation header included.
    pub max_bytes: usize,
}

/// Policies of a peer that does not go with ours, by their names in rclcpp and in words for the operator.
pub(crate) const RELIABILITY_CONFLICT: &str =
    "RELIABILITY_QOS_POLICY (the subscription asks for reliable, the publisher offers best_effort)";
pub(crate) const DURABILITY_CONFLICT: &str = "DURABILITY_QOS_POLICY (the subscription asks for transient_local, the publisher offers volatile)";

/// A change of the other ends of our endpoints, or of what there is.
#[derive(Clone, Debug)]
pub(crate) enum PortEvent {
    /// An endpoint of ours and a peer have found each other.
    Matched {
        endpoint: EndpointId,
        peer: EndpointId,
    },
    /// A peer does not go with ours, in this policy of its QoS or in its type.
    Incompatible {
        endpoint: EndpointId,
        peer: EndpointId,
        policy: Cow<'static, str>,
    },
    /// There is a publisher, on any topic of ROS.
    Found {
        peer: EndpointId,
        publisher: Box<RemotePublisher>,
        /// Its node, where it names one.
        node: Option<String>,
    },
    /// There is a subscription or a server.
    FoundOther {
        peer: EndpointId,
        role: GraphRole,
        name: String,
        /// Its node, where it names one.
        node: Option<String>,
    },
    /// A peer has gone.
    Lost { peer: EndpointId },
}

/// Bytes of samples that are not acknowledged, of a writer that keeps them: 5 s of a lidar that sends 12 MB in each.
pub(crate) const UNACKNOWLEDGED_BYTES: usize = 64 << 20;

/// A participant on a network.
pub(crate) trait Transport: Send + Sync {
    /// Identity of the participant.
    fn id(&self) -> EndpointId;

    /// Participants that security keeps out. Each is a warning in the log; to be asked once a second.
    fn unauthenticated_participants(&self) -> usize {
        0
    }

    /// Announces a node. Where nodes are announced by messages instead, see [`Transport::graph_writer`].
    fn add_node(&self, _: &PortNode) -> Result<(), RuntimeError> {
        Ok(())
    }

    /// Writer of the messages that name the nodes of a process. `None`: every endpoint names its node itself.
    fn graph_writer(&self) -> Option<Result<Arc<dyn SampleWriter>, RuntimeError>> {
        None
    }

    /// Reader of these messages of other processes.
    fn graph_reader(&self) -> Option<Result<Box<dyn SampleReader>, RuntimeError>> {
        None
    }

    /// Makes a writer. One that `keeps` overwrites no sample that a reliable reader has not acknowledged, however
    /// many there are, within [`UNACKNOWLEDGED_BYTES`].
    fn writer(
        &self,
        topic: PortTopic<'_>,
        qos: &Qos,
        keeps: bool,
    ) -> Result<Arc<dyn SampleWriter>, RuntimeError>;

    /// Makes a reader that refuses samples longer than `max_bytes`, header included.
    fn reader(
        &self,
        topic: PortTopic<'_>,
        qos: &Qos,
        max_bytes: usize,
    ) -> Result<Box<dyn SampleReader>, RuntimeError>;

    /// Makes both ends of a server.
    fn server(
        &self,
        service: PortService<'_>,
        qos: &ServiceQos,
    ) -> Result<ServerEnds, RuntimeError>;

    /// Makes both ends of a client.
    fn client(
        &self,
        service: PortService<'_>,
        qos: &ServiceQos,
    ) -> Result<ClientEnds, RuntimeError>;

    /// Changes of peers. Only one stream hears them.
    fn events(&self) -> BoxStream<'static, PortEvent>;
}

/// Reason why a sample was not written.
#[derive(Debug)]
pub(crate) enum WriteRefusal {
    /// The send window is full.
    Full,
    /// In the words of the transport.
    Failed(String),
}

/// The sending end of a topic.
pub(crate) trait SampleWriter: Send + Sync {
    /// Its identity.
    fn id(&self) -> EndpointId;

    /// Writes the body of a little-endian CDR sample, and the request that it answers or is.
    fn write(
        &self,
        body: Bytes,
        related: Option<SampleId>,
    ) -> BoxFuture<'_, Result<(), WriteRefusal>>;

    /// Samples that reliable readers had not acknowledged when they left, and those that are not acknowledged yet.
    /// None where the transport does not tell.
    fn unacknowledged(&self) -> u64 {
        0
    }

    /// Waits until every reliable reader has acknowledged. False: not in time.
    fn wait_for_acknowledgments(&self, patience: Duration) -> bool;
}

/// Samples that a reader does not have.
#[derive(Clone, Debug, Default)]
pub(crate) struct ReaderLosses {
    /// Sent by a writer that was heard before and after them, and not received: lost by the network, or given up by the
    /// writer.
    pub on_network: Arc<AtomicU64>,
    /// Received, and displaced by newer ones before they were taken.
    pub overrun: Arc<AtomicU64>,
}

/// The receiving end of a topic.
pub(crate) trait SampleReader: Send + Sync {
    /// Its identity.
    fn id(&self) -> EndpointId;

    /// The next sample; see [`SampleReader::next`].
    fn poll_next(&self, context: &mut Context<'_>) -> Poll<Result<Origin, String>>;

    /// Bytes of the last sample, encapsulation header first.
    fn bytes(&self) -> MutexGuard<'_, Vec<u8>>;

    /// True once a matched writer is known to have matched too, so that its next sample comes here. Always, where the
    /// transport finds the way by itself.
    fn is_known_to(&self, _: &EndpointId) -> bool {
        true
    }

    /// Counters of the samples that are not had; clones share them.
    fn losses(&self) -> ReaderLosses;
}

impl dyn SampleReader + '_ {
    /// The next sample; its bytes are in [`SampleReader::bytes`] until the next call.
    ///
    /// The error is a sample that cannot be had, in words; the one after it can.
    pub(crate) async fn next(&self) -> Result<Origin, String> {
        poll_fn(|context| self.poll_next(context)).await
    }
}
