//! Identifiers.

use serde::{Deserialize, Serialize};

use crate::interface::messages;

messages! {
    "unique_identifier_msgs" in "../definitions/unique_identifier_msgs/";
    UUID [];
}

/// A universally unique identifier (RFC 4122).
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize,
)]
pub struct UUID {
    /// Bytes in network order.
    pub uuid: [u8; 16],
}
