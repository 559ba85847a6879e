//! Simulated time.

use serde::{Deserialize, Serialize};

use crate::builtin_interfaces::Time;
use crate::interface::messages;

messages! {
    "rosgraph_msgs" in "../definitions/rosgraph_msgs/";
    Clock [Time];
}

/// The time that nodes with use_sim_time follow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Clock {
    /// Now.
    pub clock: Time,
}
