//! The port of the transport: everything that the runtime asks of DDS, in terms of no implementation.

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
use super::remote::RemotePublisher;

/// Buffer of a sample that writers share.
pub(crate) use bytes::Bytes;

/// Length of the encapsulation header in front of every CDR sample.
pub(crate) const ENCAPSULATION_BYTES: usize = 4;

/// Receive buffer asked of every socket, in bytes.
pub(crate) const RECEIVE_BUFFER_BYTES: usize = 32 << 20;

/// Identity of a reader or writer, the GUID of DDS: twelve bytes name the participant.
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
    pub(crate) fn is_beside(&self, other: &Self) -> bool {
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

/// Topic of an endpoint.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PortTopic<'a> {
    /// Name in ROS, for messages.
    pub name: &'a str,
    /// Name in DDS.
    pub dds_name: &'a str,
    /// Type, such as `sensor_msgs/msg/Imu`.
    pub ros_type: &'a str,
    /// Hash of the type where it may be another than that of our message of this name.
    pub type_hash: Option<&'a str>,
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
    },
    /// There is a reader, on any topic of DDS.
    FoundReader { peer: EndpointId, dds_name: String },
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
    fn strangers(&self) -> usize {
        0
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

    /// Writes the body of a little-endian CDR sample, and the request that it answers.
    fn write(
        &self,
        body: Bytes,
        related: Option<SampleId>,
    ) -> BoxFuture<'_, Result<(), WriteRefusal>>;

    /// Samples that reliable readers had not acknowledged when they left, and those that are not acknowledged yet.
    fn unacknowledged(&self) -> u64;

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
