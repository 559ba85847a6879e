//! Nodes and rights of clients.

/// Nodes accessible to clients.
#[derive(Clone, Debug)]
pub struct BridgeOptions {
    /// True if clients may change state.
    pub allow_write: bool,
    /// Name of the mapper.
    pub mapper: String,
    /// Name of the bag player.
    pub player: String,
    /// Nodes whose parameters clients may read and set.
    pub parameter_nodes: Vec<String>,
    /// Topic of goals (`geometry_msgs/PoseStamped`).
    pub goal_topic: String,
    /// Limits of headset messages from clients; `None`: not allowed.
    pub headset: Option<HeadsetLimits>,
}

/// Limits of headset messages from clients.
#[derive(Clone, Debug)]
pub struct HeadsetLimits {
    /// Longest message, bytes.
    pub message_bytes: usize,
    /// Rate limit per client, bytes per second.
    pub bytes_per_s: usize,
    /// Name of the calibration node.
    pub calibrator: String,
}
