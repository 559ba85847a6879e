//! Facts of a graph of nodes and of this machine, from which the findings follow.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use lattice_runtime::qos::{Durability, Reliability};
use lattice_runtime::{GraphRole, RemoteEndpoint};
use serde::{Serialize, Serializer};

/// All facts.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Facts {
    /// Version of this program.
    pub version: String,
    pub network: NetworkFacts,
    pub machine: Machine,
    /// Endpoints of other processes.
    pub endpoints: Vec<Endpoint>,
    pub time: TimeFacts,
    /// Folders of maps of the nodes.
    pub map_dirs: Vec<MapDir>,
}

/// Settings of this shell.
#[derive(Clone, Debug, Default, Serialize)]
pub struct NetworkFacts {
    /// Transport in use, as a name of `RMW_IMPLEMENTATION`.
    pub transport: String,
    /// `RMW_IMPLEMENTATION`, if set.
    pub rmw_implementation: Option<String>,
    pub domain: u16,
    pub range: Range,
    pub static_peers: Vec<String>,
    /// Warnings about variables.
    pub warnings: Vec<String>,
    /// Error of joining the graph.
    pub error: Option<String>,
    /// Variables of Fast DDS that are set; Cyclone does not read them.
    pub fast_dds_settings: Vec<String>,
}

impl NetworkFacts {
    /// True for DDS, false for Zenoh.
    pub fn is_dds(&self) -> bool {
        !self.transport.contains("zenoh")
    }
}

/// Discovery range.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "UPPERCASE")]
pub enum Range {
    #[default]
    Subnet,
    Localhost,
    Off,
}

impl Range {
    /// Value of `ROS_AUTOMATIC_DISCOVERY_RANGE`.
    pub fn name(self) -> &'static str {
        match self {
            Range::Subnet => "SUBNET",
            Range::Localhost => "LOCALHOST",
            Range::Off => "OFF",
        }
    }
}

/// This machine.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Machine {
    pub interfaces: Vec<Interface>,
    /// Error of a multicast datagram of this process to itself.
    pub multicast_error: Option<String>,
    /// Receive buffer that a socket may have, bytes.
    pub rmem_max: Option<u64>,
    /// Processes of this machine with sockets of DDS, without this one.
    pub processes: Vec<Process>,
    /// Addresses of participants that announce themselves in other domains by multicast.
    pub other_domains: BTreeMap<u16, BTreeSet<String>>,
}

/// A network interface that is up.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Interface {
    pub name: String,
    pub is_loopback: bool,
    pub has_multicast: bool,
}

/// A process with sockets in a DDS domain.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Process {
    /// `None` for a process of another user.
    pub pid: Option<u32>,
    pub name: String,
    pub domain: u16,
    /// `ROS_AUTOMATIC_DISCOVERY_RANGE` of its environment; LOCALHOST with `ROS_LOCALHOST_ONLY`.
    pub range: Option<String>,
    /// `RMW_IMPLEMENTATION` of its environment.
    pub rmw_implementation: Option<String>,
    /// Working directory.
    pub folder: Option<PathBuf>,
}

impl Process {
    /// Name for a message.
    pub fn title(&self) -> String {
        match self.pid {
            Some(pid) => format!("{} (process {pid})", self.name),
            None => self.name.clone(),
        }
    }
}

/// A publisher, subscription or server of another process.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Endpoint {
    #[serde(serialize_with = "role")]
    pub role: GraphRole,
    /// Full name of its topic or service.
    pub topic: String,
    /// Full name of its node, or the GID of the endpoint in hexadecimal if its participant announces no ROS node.
    pub node: String,
    /// GUID prefix of its participant.
    pub participant: Option<String>,
    pub type_name: Option<String>,
    pub type_hash: Option<String>,
    pub is_reliable: bool,
    pub is_transient_local: bool,
}

fn role<S: Serializer>(role: &GraphRole, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(match role {
        GraphRole::Publisher => "publisher",
        GraphRole::Subscriber => "subscription",
        GraphRole::Server => "server",
    })
}

impl From<RemoteEndpoint> for Endpoint {
    fn from(of: RemoteEndpoint) -> Self {
        let announced = of.announced.as_ref();
        Self {
            role: of.endpoint.role,
            topic: of.endpoint.name,
            node: of.endpoint.node,
            participant: of.participant,
            type_name: announced.map(|of| of.type_name.clone()),
            type_hash: announced.and_then(|of| of.type_hash.clone()),
            is_reliable: announced.is_some_and(|of| of.reliability == Reliability::Reliable),
            is_transient_local: announced
                .is_some_and(|of| of.durability == Durability::TransientLocal),
        }
    }
}

/// Stamps and transforms of messages.
#[derive(Clone, Debug, Default, Serialize)]
pub struct TimeFacts {
    /// `/clock` minus the clock of this machine, s; `None`: no message on `/clock`.
    pub simulated_s: Option<f64>,
    pub stamps: Vec<Stamps>,
    pub frames: Vec<Frame>,
}

/// Stamps of the messages of a topic.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Stamps {
    pub topic: String,
    /// Stamp of the last message minus the time of its receipt, s, by `/clock` where there is one.
    pub offset_s: f64,
}

/// A frame of tf.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Frame {
    pub child: String,
    pub parents: BTreeSet<String>,
    /// Newest stamp minus the time now, s; `None` on `/tf_static`.
    pub offset_s: Option<f64>,
}

/// Folder of the maps of a node.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct MapDir {
    pub node: String,
    pub path: PathBuf,
    /// Free bytes; `None`: not on this machine.
    pub free_bytes: Option<u64>,
}
