//! Parameters of the viewer.

use super::bridge::{BridgeOptions, HeadsetLimits};
use super::options::ViewerOptions;
use super::session::MAX_MESSAGE_BYTES;
use crate::compute::ComputeLimits;
use crate::options::{self, TOPIC};
use crate::report;
use lattice_runtime::about;
use lattice_runtime::params::{About, ParamError, Params};

const ABOUT: &[About] = about! {
    "address" fixed(SOCKET): "Address to listen on. Any but 127.0.0.1 (or ::1) requires the token.";
    "port" fixed(SOCKET): "Port of the page and the WebSocket; 0: a free one.";
    "token" fixed(SOCKET): "Secret of clients, letters, digits, -, _ and .; empty: none on 127.0.0.1, else a random one, in the address printed to standard error only.";
    "tls" fixed(SOCKET): "Whether HTTPS and wss are served in place of HTTP and ws: with tls_certificate and tls_key, else with a self-made certificate that is kept with its key.";
    "tls_certificate" fixed(SOCKET): "File with the certificate and its chain (PEM); empty: a self-made one.";
    "tls_key" fixed(SOCKET): "File with the private key of the certificate (PEM), not readable by other users.";
    "allowed_hosts" fixed(SOCKET): "Host names of this machine for browsers, besides localhost and addresses.";
    "allowed_origins" fixed(SOCKET): "Allowed cross-origin pages, such as https://viewer.example.";
    "max_clients" fixed(SOCKET): "Limit of clients.";
    "max_voxels" fixed("the map is followed with it"): "Voxel limit of the followed map.";
    "update_period_s": "Period of map updates to clients.";
    "cloud_topics" fixed(TOPIC): "Topics of clouds available to clients (sensor_msgs/PointCloud2).";
    "allow_write" fixed(WRITING): "Whether clients may clear and save the map, play logs, set parameters and send goals; requires no more than the token.";
    "allow_headset" fixed(WRITING): "Whether clients may publish headset topics (headset/mesh, headset/pose and so on) and request a calibration; requires no more than the token.";
    "headset_message_bytes" fixed(WRITING): "Largest such message, bytes.";
    "headset_bytes_per_s" fixed(WRITING): "Rate limit of such messages per client; excess messages are rejected and counted.";
    "calibrator" fixed(WRITING): "Node for calibration requests of clients.";
    "player" fixed(WRITING): "Node of the bag player.";
    "parameter_nodes" fixed(WRITING): "Nodes whose parameters clients may set.";
    "goal_topic" fixed(WRITING): "Topic of goals from clients (geometry_msgs/PoseStamped).";
};

const WRITING: &str = "what clients may do is settled at the start";
const SOCKET: &str = "the server is made with it";

/// Settings from the parameters of the node.
pub(super) struct Settings {
    pub viewer: ViewerOptions,
    pub limits: ComputeLimits,
    pub reach: BridgeOptions,
    pub report_file: String,
}

impl Settings {
    /// Reads the parameters of the node.
    pub(super) fn from_params(params: &Params) -> Result<Self, ParamError> {
        params.describe(ABOUT);
        params.describe(options::COMMON);
        Ok(Self {
            viewer: ViewerOptions::from_params(params)?,
            limits: options::compute_limits(params, 4096, 64 << 20, options::threads(params, 1)?)?,
            reach: BridgeOptions {
                allow_write: params.bool("allow_write", false)?,
                mapper: params.string("mapper", "lattice_mapper")?,
                player: params.string("player", "bag_player")?,
                parameter_nodes: params.string_array("parameter_nodes", &["lattice_mapper"])?,
                goal_topic: params.string("goal_topic", "goal_pose")?,
                headset: headset(params)?,
            },
            report_file: report::file(params)?,
        })
    }
}

/// Limits of headset messages from clients, if allowed.
fn headset(params: &Params) -> Result<Option<HeadsetLimits>, ParamError> {
    let allow = params.bool("allow_headset", false)?;
    let message_bytes = params.usize_in(
        "headset_message_bytes",
        4 << 20,
        MAX_MESSAGE_BYTES..=64 << 20,
    )?;
    let bytes_per_s = params.usize_in("headset_bytes_per_s", 32 << 20, 4096..=1 << 30)?;
    if bytes_per_s < message_bytes {
        let problem = format!("expected at least `headset_message_bytes`, {message_bytes}");
        return Err(params.invalid("headset_bytes_per_s", problem));
    }
    let calibrator = params.string("calibrator", "semantic_icp_server")?;
    Ok(allow.then_some(HeadsetLimits {
        message_bytes,
        bytes_per_s,
        calibrator,
    }))
}

/// Declares all parameters of the node, as at its start.
pub fn declare(params: &Params) -> Result<(), ParamError> {
    Settings::from_params(params).map(drop)
}
