//! Errors between a node and the network.

use thiserror::Error;

use super::env::EnvError;
use super::names::NameError;
use super::params::ParamError;
use super::security::SecurityError;

/// Reason why a runtime, a node or an endpoint cannot be made.
#[derive(Debug, Error)]
pub enum RuntimeError {
    /// No DDS participant.
    #[error(
        "cannot join DDS domain {domain}: {reason}; check ROS_DOMAIN_ID (0..=232) and the network interfaces"
    )]
    Participant {
        /// The domain.
        domain: u16,
        /// In the words of the transport.
        reason: String,
    },
    /// No Zenoh session.
    #[error("cannot open the Zenoh session: {reason}")]
    Session {
        /// In words.
        reason: String,
    },
    /// No endpoint.
    #[error("{topic}: cannot create the {endpoint}: {reason}")]
    Endpoint {
        /// Resolved topic or service.
        topic: String,
        /// `publisher`, `subscription` or `service`.
        endpoint: &'static str,
        /// In the words of the transport.
        reason: String,
    },
    /// Not the name of a ROS type.
    #[error("{topic}: {type_name:?} is not a type name like sensor_msgs/msg/PointCloud2")]
    TypeName {
        /// Resolved topic.
        topic: String,
        /// The name given.
        type_name: String,
    },
    /// Two types on one topic.
    #[error(
        "{topic}: is used as {have} in this process and cannot be {want} too; remap one of them"
    )]
    TypeMismatch {
        /// Resolved topic.
        topic: String,
        /// Type in use.
        have: String,
        /// Type asked for.
        want: String,
    },
    /// A name is not valid.
    #[error(transparent)]
    Name(#[from] NameError),
    /// A parameter is not valid.
    #[error(transparent)]
    Param(#[from] ParamError),
    /// The environment is not valid.
    #[error(transparent)]
    Env(#[from] EnvError),
    /// Security is enforced and cannot be had, or refuses.
    #[error(transparent)]
    Security(#[from] SecurityError),
    /// No thread.
    #[error("cannot start a thread: {0}")]
    Thread(#[from] std::io::Error),
    /// A thread cannot go on.
    #[error("thread {thread} panicked; this is a bug, please report the message above")]
    Panicked {
        /// Its name.
        thread: &'static str,
    },
    /// The runtime has shut down.
    #[error("{topic}: the runtime has shut down")]
    Closed {
        /// Resolved topic or service.
        topic: String,
    },
}

/// Reason why a message was not queued.
#[derive(Debug, Error)]
pub enum PublishError {
    /// The queue holds as much as it may.
    #[error("{topic}: the queue of the publisher is full, message dropped ({dropped} so far)")]
    QueueFull {
        /// Resolved topic.
        topic: String,
        /// Messages dropped so far.
        dropped: u64,
    },
    /// The runtime has shut down.
    #[error("{topic}: the runtime has shut down")]
    Closed {
        /// Resolved topic.
        topic: String,
    },
    /// Not little-endian plain CDR.
    #[error("{topic}: {bytes} bytes beginning with {header:02x?} are no little-endian CDR message")]
    NotLittleEndianCdr {
        /// Resolved topic.
        topic: String,
        /// Length of the message.
        bytes: usize,
        /// Its first bytes, four at most.
        header: Vec<u8>,
    },
}
