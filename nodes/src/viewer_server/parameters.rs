//! Parameters of the viewer.

use super::bridge::{HeadsetReach, Reach};
use super::offer::MAX_MESSAGE_BYTES;
use super::options::ViewerOptions;
use crate::compute::ComputeLimits;
use crate::options::{self, TOPIC};
use crate::report;
use lattice_runtime::about;
use lattice_runtime::params::{About, ParamError, Params};

const ABOUT: &[About] = about! {
    "address" fixed(SOCKET): "Address to listen on. With any but 127.0.0.1 (or ::1) clients need the token.";
    "port" fixed(SOCKET): "Port of the page and the WebSocket; 0: one that is free.";
    "token" fixed(SOCKET): "Secret of clients, letters, digits, -, _ and .; empty: none on 127.0.0.1, else a random one, which is in the address that the node tells on standard error alone.";
    "allowed_hosts" fixed(SOCKET): "Names by which browsers may call this machine, besides localhost and addresses.";
    "allowed_origins" fixed(SOCKET): "Pages from elsewhere that may connect, such as https://viewer.example.";
    "max_clients" fixed(SOCKET): "Most clients at a time.";
    "max_voxels" fixed("the map is followed with it"): "Larger maps are not followed.";
    "update_period_s": "Time between two messages of map_updates to clients.";
    "cloud_topics" fixed(TOPIC): "Clouds that clients can have (sensor_msgs/PointCloud2).";
    "allow_write" fixed(WRITING): "Lets clients clear and save the map, play logs, set parameters and send goals; needs no more than the token.";
    "allow_headset" fixed(WRITING): "Lets clients publish what a headset sees (headset/mesh, headset/pose and so on) and ask for a calibration; needs no more than the token.";
    "headset_message_bytes" fixed(WRITING): "Longest such message, bytes.";
    "headset_bytes_per_s" fixed(WRITING): "Most bytes of such messages that a client may send in a second; what is beyond is refused and counted.";
    "calibrator" fixed(WRITING): "Node that clients ask for a calibration.";
    "player" fixed(WRITING): "Node that plays a log.";
    "parameter_nodes" fixed(WRITING): "Nodes whose parameters clients may set.";
    "goal_topic" fixed(WRITING): "Topic of goals of clients (geometry_msgs/PoseStamped).";
};

const WRITING: &str = "what clients may do is settled at the start";
const SOCKET: &str = "the server is made with it";

/// Settings from the parameters of the node.
pub(super) struct Settings {
    pub viewer: ViewerOptions,
    pub limits: ComputeLimits,
    pub reach: Reach,
    pub report_file: String,
}

impl Settings {
    /// Reads the parameters of the node.
    pub(super) fn from_params(params: &Params) -> Result<Self, ParamError> {
        params.describe(ABOUT);
        params.describe(options::COMMON);
        Ok(Self {
            viewer: ViewerOptions::from_params(params)?,
            limits: ComputeLimits {
                events: options::inbox_events(params, 4096)?,
                bytes: options::inbox_bytes(params, 64 << 20)?,
                threads: options::threads(params, 1)?,
            },
            reach: Reach {
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
fn headset(params: &Params) -> Result<Option<HeadsetReach>, ParamError> {
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
    Ok(allow.then_some(HeadsetReach {
        message_bytes,
        bytes_per_s,
        calibrator,
    }))
}

/// Declares all parameters of the node, as at its start.
pub fn declare(params: &Params) -> Result<(), ParamError> {
    Settings::from_params(params).map(drop)
}
