//! Time and duration.

use serde::{Deserialize, Serialize};

use crate::interface::messages;

messages! {
    "builtin_interfaces" in "../definitions/builtin_interfaces/";
    Time [];
    Duration [];
}

/// A point in time, since the epoch of the clock in use (Unix epoch for system time).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Time {
    /// Whole seconds, negative before the epoch.
    pub sec: i32,
    /// Nanoseconds after sec, in [0, 1e9).
    pub nanosec: u32,
}

/// A signed span of time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Duration {
    /// Whole seconds, may be negative.
    pub sec: i32,
    /// Nanoseconds after sec, in [0, 1e9).
    pub nanosec: u32,
}
