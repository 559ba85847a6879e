//! Abstract transport: all network functions that the runtime uses, independent of the implementation.

use std::borrow::Cow;
use std::future::poll_fn;
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, MutexGuard};
use std::task::{Context, Poll};
use std::time::Duration;

use futures::future::BoxFuture;
use futures::stream::BoxStream;

use super::qos::Qos;
use super::remote::{Announced, GraphRole, RemotePublisher};
use crate::error::RuntimeError;

/// Sample buffer shared by writers.
pub(crate) use bytes::Bytes;

/// Length of the encapsulation header of every CDR sample.
pub(crate) const ENCAPSULATION_BYTES: usize = 4;

/// DDS topic of the messages that list the nodes of a process.
pub(crate) const GRAPH_TOPIC: &str = "ros_discovery_info";

/// Requested receive buffer of every socket, bytes.
pub(crate) const RECEIVE_BUFFER_BYTES: usize = 32 << 20;

/// Identity of an endpoint: on DDS its GUID, whose first twelve bytes identify the participant; on Zenoh its gid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct EndpointId(pub [u8; 16]);

impl EndpointId {
    /// Vendor id: first two bytes.
    pub(crate) fn vendor(&self) -> [u8; 2] {
        let [first, second, ..] = self.0;
        [first, second]
    }

    /// Hexadecimal form.
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

/// Identity of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct SampleId {
    /// Writer of the sample, or the endpoint that the sender names instead.
    pub writer: EndpointId,
    /// Sequence number; 0 if the sender gives none.
    pub number: i64,
}

/// Origin of a received sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Origin {
    /// The sample itself.
    pub sample: SampleId,
    /// Related request, if the sender gives one.
    pub related: Option<SampleId>,
}

/// A node of this process.
#[derive(Clone, Debug)]
#[cfg_attr(not(feature = "zenoh"), expect(dead_code, reason = "DDS has no nodes"))]
pub(crate) struct PortNode {
    /// Index in the process.
    pub number: usize,
    /// Namespace, such as `/` or `/robot`.
    pub namespace: String,
    /// Name without namespace.
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
    /// Type hash, if it may differ from the hash of our message with this name.
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

/// Representation of requests and replies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ServiceForm {
    /// Samples on two topics, in the format of the peer's rmw. A reply is lost to a client whose reader is
    /// not matched yet.
    Topics,
    /// Bare messages; the transport identifies the request and routes the reply.
    Queries,
}

/// Both ends of a server.
pub(crate) struct ServerEnds {
    pub form: ServiceForm,
    pub requests: Box<dyn SampleReader>,
    /// Writer of replies; each is written with its request.
    pub replies: Arc<dyn SampleWriter>,
}

/// Both ends of a client.
pub(crate) struct ClientEnds {
    pub form: ServiceForm,
    /// Writer of requests; with [`ServiceForm::Queries`] a request identifies itself.
    pub requests: Arc<dyn SampleWriter>,
    pub answers: Box<dyn SampleReader>,
}

/// QoS of both ends of a server or client.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ServiceQos {
    pub reader: Qos,
    pub writer: Qos,
    /// Longest accepted sample, encapsulation header included.
    pub max_bytes: usize,
}

/// Incompatible QoS policies, by their names in rclcpp, with an explanation.
pub(crate) const RELIABILITY_CONFLICT: &str =
    "RELIABILITY_QOS_POLICY (the subscription requests reliable, the publisher offers best_effort)";
pub(crate) const DURABILITY_CONFLICT: &str = "DURABILITY_QOS_POLICY (the subscription requests transient_local, the publisher offers volatile)";

/// Discovery event.
#[derive(Clone, Debug)]
pub(crate) enum PortEvent {
    /// A local endpoint and a peer have matched.
    Matched {
        endpoint: EndpointId,
        peer: EndpointId,
    },
    /// A peer has incompatible QoS or type; the policy is given.
    Incompatible {
        endpoint: EndpointId,
        peer: EndpointId,
        policy: Cow<'static, str>,
    },
    /// A publisher was discovered, on any ROS topic.
    Found {
        peer: EndpointId,
        publisher: Box<RemotePublisher>,
        /// Node of the endpoint, if announced.
        node: Option<String>,
    },
    /// A subscription or server was discovered.
    FoundOther {
        peer: EndpointId,
        role: GraphRole,
        name: String,
        /// Type and QoS of a subscription.
        announced: Option<Box<Announced>>,
        /// Node of the endpoint, if announced.
        node: Option<String>,
    },
    /// A peer has left.
    Lost { peer: EndpointId },
}

/// Limit of unacknowledged bytes of a writer that keeps them: 5 s of a lidar at 12 MB/s.
pub(crate) const UNACKNOWLEDGED_BYTES: usize = 64 << 20;

/// A participant on a network.
pub(crate) trait Transport: Send + Sync {
    /// Identity of the participant.
    fn id(&self) -> EndpointId;

    /// Number of participants rejected by DDS Security. Logs a warning for each; call once a second.
    fn unauthenticated_participants(&self) -> usize {
        0
    }

    /// Announces a node. Transports that announce nodes by messages use [`Transport::graph_writer`].
    fn add_node(&self, _: &PortNode) -> Result<(), RuntimeError> {
        Ok(())
    }

    /// Writer of node lists. `None`: every endpoint announces its node itself.
    fn graph_writer(&self) -> Option<Result<Arc<dyn SampleWriter>, RuntimeError>> {
        None
    }

    /// Reader of the node lists of other processes.
    fn graph_reader(&self) -> Option<Result<Box<dyn SampleReader>, RuntimeError>> {
        None
    }

    /// Creates a writer. With `keeps`, it never overwrites a sample that a reliable reader has not acknowledged,
    /// up to [`UNACKNOWLEDGED_BYTES`].
    fn writer(
        &self,
        topic: PortTopic<'_>,
        qos: &Qos,
        keeps: bool,
    ) -> Result<Arc<dyn SampleWriter>, RuntimeError>;

    /// Creates a reader that rejects samples longer than `max_bytes`, header included.
    fn reader(
        &self,
        topic: PortTopic<'_>,
        qos: &Qos,
        max_bytes: usize,
    ) -> Result<Box<dyn SampleReader>, RuntimeError>;

    /// Creates both ends of a server.
    fn server(
        &self,
        service: PortService<'_>,
        qos: &ServiceQos,
    ) -> Result<ServerEnds, RuntimeError>;

    /// Creates both ends of a client.
    fn client(
        &self,
        service: PortService<'_>,
        qos: &ServiceQos,
    ) -> Result<ClientEnds, RuntimeError>;

    /// Stream of discovery events. It has one consumer.
    fn events(&self) -> BoxStream<'static, PortEvent>;
}

/// Reason why a sample was not written.
#[derive(Debug)]
pub(crate) enum WriteRefusal {
    /// The send window is full.
    Full,
    /// Error of the transport.
    Failed(String),
}

/// Sending end of a topic.
pub(crate) trait SampleWriter: Send + Sync {
    /// Identity of the endpoint.
    fn id(&self) -> EndpointId;

    /// Writes the body of a little-endian CDR sample, with the identity of its request, if any.
    fn write(
        &self,
        body: Bytes,
        related: Option<SampleId>,
    ) -> BoxFuture<'_, Result<(), WriteRefusal>>;

    /// True if the transport keeps samples for late joiners even before a peer is matched.
    fn keeps_samples(&self) -> bool {
        false
    }

    /// True if the transport has a reader for the samples of this writer, also one that announces no endpoint.
    fn has_reader(&self) -> bool {
        false
    }

    /// True if this body is sent although its write was given up.
    fn is_sending(&self, _: &Bytes) -> bool {
        false
    }

    /// Samples not yet acknowledged, or left unacknowledged by reliable readers that have left.
    /// 0 if the transport does not report them.
    fn unacknowledged(&self) -> u64 {
        0
    }

    /// Waits until every reliable reader has acknowledged. False: timeout.
    fn wait_for_acknowledgments(&self, patience: Duration) -> bool;
}

/// Lost samples of a reader.
#[derive(Clone, Debug, Default)]
pub(crate) struct ReaderLosses {
    /// Missing in the sequence of a writer: lost by the network, or overwritten in the writer's
    /// history.
    pub on_network: Arc<AtomicU64>,
    /// Received, but overwritten by newer samples before they were taken.
    pub overrun: Arc<AtomicU64>,
}

/// Receiving end of a topic.
pub(crate) trait SampleReader: Send + Sync {
    /// Identity of the endpoint.
    fn id(&self) -> EndpointId;

    /// Polls for the next sample; see [`SampleReader::next`].
    fn poll_next(&self, context: &mut Context<'_>) -> Poll<Result<Origin, String>>;

    /// Bytes of the last sample, encapsulation header first.
    fn bytes(&self) -> MutexGuard<'_, Vec<u8>>;

    /// True once a matched writer has matched this reader too, so that its next sample arrives. Always true if the
    /// transport routes by itself.
    fn is_known_to(&self, _: &EndpointId) -> bool {
        true
    }

    /// Counters of lost samples; clones share them.
    fn losses(&self) -> ReaderLosses;
}

impl dyn SampleReader + '_ {
    /// Awaits the next sample; its bytes are in [`SampleReader::bytes`] until the next call.
    ///
    /// The error describes a rejected sample; the next call continues with the one after it.
    pub(crate) async fn next(&self) -> Result<Origin, String> {
        poll_fn(|context| self.poll_next(context)).await
    }
}
