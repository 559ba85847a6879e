//! Errors between a node and the network.

use thiserror::Error;

use crate::config::env::EnvError;
use crate::config::names::NameError;
use crate::config::params::ParamError;
use crate::config::security::SecurityError;

/// Reason why a runtime, a node or an endpoint cannot be made.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RuntimeError {
    /// The DDS participant could not be created.
    #[error(
        "cannot join DDS domain {domain}: {reason}; check ROS_DOMAIN_ID (0..=232) and the network interfaces"
    )]
    Participant {
        /// The domain.
        domain: u16,
        /// Error of the transport.
        reason: String,
    },
    /// The Zenoh session could not be opened.
    #[error("cannot open the Zenoh session: {reason}")]
    Session {
        /// Error of the transport.
        reason: String,
    },
    /// The endpoint could not be created.
    #[error("{topic}: cannot create the {endpoint}: {reason}")]
    Endpoint {
        /// Resolved topic or service.
        topic: String,
        /// `publisher`, `subscription` or `service`.
        endpoint: &'static str,
        /// Error of the transport.
        reason: String,
    },
    /// Invalid type name.
    #[error("{topic}: {type_name:?} is not a type name like sensor_msgs/msg/PointCloud2")]
    TypeName {
        /// Resolved topic.
        topic: String,
        /// The name given.
        type_name: String,
    },
    /// Conflicting types on one topic.
    #[error(
        "{topic}: already used with type {have} in this process, not {want}; remap one of them"
    )]
    TypeMismatch {
        /// Resolved topic.
        topic: String,
        /// Type in use.
        have: String,
        /// Requested type.
        want: String,
    },
    /// Invalid name.
    #[error(transparent)]
    Name(#[from] NameError),
    /// Invalid parameter.
    #[error(transparent)]
    Param(#[from] ParamError),
    /// Invalid environment.
    #[error(transparent)]
    Env(#[from] EnvError),
    /// Security is enforced and unavailable, or denies access.
    #[error(transparent)]
    Security(#[from] SecurityError),
    /// A thread could not be started.
    #[error("cannot start a thread: {0}")]
    Thread(#[from] std::io::Error),
    /// A thread panicked.
    #[error("thread {thread} panicked; this is a bug, please report the message above")]
    Panicked {
        /// Name of the thread.
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
#[non_exhaustive]
pub enum PublishError {
    /// The queue is full.
    #[error(
        "{topic}: the queue of the publisher is full, message dropped ({dropped} so far): publish fewer or smaller messages"
    )]
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
    #[error(
        "{topic}: {bytes} bytes beginning with {header:02x?} are not a little-endian plain CDR message"
    )]
    NotLittleEndianCdr {
        /// Resolved topic.
        topic: String,
        /// Length of the message.
        bytes: usize,
        /// First bytes of the message, up to four.
        header: Vec<u8>,
    },
}
