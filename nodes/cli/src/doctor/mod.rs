//! `lattice doctor`: why nodes do not find each other or get no messages.

mod announcements;
mod facts;
mod findings;
mod machine;
mod messages;
mod page;
mod processes;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

use clap::Args;
use lattice_msgs::cdr;
use lattice_msgs::rcl_interfaces::{GetParameters, GetParametersRequest, GetParametersResponse};
use lattice_runtime::env::Network;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{GraphRole, Node, Runtime};

use self::announcements::Announcements;
use self::facts::{Endpoint, Facts, Machine, MapDir, NetworkFacts, Range};
use self::messages::Messages;
use super::{CliResult, init_logging};

/// Name of the node of this command.
const NAME: &str = "lattice_doctor";

/// Discovery time: participants of Fast DDS announce themselves every 3 s.
const DISCOVERY: Duration = Duration::from_secs(3);

/// Time for messages.
const RECEPTION: Duration = Duration::from_secs(2);

/// Time for the parameters of all nodes.
const ANSWERS: Duration = Duration::from_secs(2);

/// Variables of Fast DDS that change discovery.
const FAST_DDS_SETTINGS: [&str; 4] = [
    "FASTDDS_BUILTIN_TRANSPORTS",
    "FASTDDS_DEFAULT_PROFILES_FILE",
    "FASTRTPS_DEFAULT_PROFILES_FILE",
    "ROS_DISCOVERY_SERVER",
];

/// Find out why nodes do not discover each other or receive no messages
///
/// It joins the graph for a few seconds and prints findings with their remedies, the most severe first, then facts:
/// domain, discovery range, multicast, buffers, clocks, QoS, types, names, transforms, disks. The exit status is 0
/// without findings, and 1 with some.
#[derive(Args)]
pub struct Doctor {
    /// Print findings and facts as JSON
    #[arg(long)]
    json: bool,
    /// As for any ROS node: `-- --ros-args -r /tf:=/robot/tf ...`
    #[arg(last = true)]
    ros_args: Vec<String>,
}

impl Doctor {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        init_logging();
        let quiet = ["--ros-args", "--disable-rosout-logs"].map(str::to_owned);
        let args = RosArgs::parse(self.ros_args.iter().cloned().chain(quiet))?;
        let mut network = Network::from_env()?;
        let settings = settings(&network);
        // They are findings.
        network.warnings.clear();
        let facts = match Runtime::with_transport(NAME, args, &network) {
            Ok(runtime) => collect(&runtime.node(NAME)?, settings)?,
            Err(error) => alone(settings, &error.to_string()),
        };
        let findings = findings::findings(&facts);
        match self.json {
            true => println!("{}", page::json(&findings, &facts)?),
            false => print!("{}", page::text(&findings, &facts)),
        }
        match findings.len() {
            0 => Ok(()),
            1 => Err("1 finding".into()),
            number => Err(format!("{number} findings").into()),
        }
    }
}

/// Settings of this shell.
fn settings(network: &Network) -> NetworkFacts {
    let set = |name: &&str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    let fast_dds = FAST_DDS_SETTINGS.iter().filter(|name| set(name));
    NetworkFacts {
        transport: network.transport.name().to_owned(),
        rmw_implementation: std::env::var("RMW_IMPLEMENTATION").ok(),
        domain: network.domain_id,
        range: match (network.discovery_off, network.localhost_only) {
            (true, _) => Range::Off,
            (false, true) => Range::Localhost,
            (false, false) => Range::Subnet,
        },
        static_peers: network.static_peers.clone(),
        warnings: network.warnings.clone(),
        error: None,
        fast_dds_settings: fast_dds.map(|name| (*name).to_owned()).collect(),
    }
}

/// Facts of a machine that cannot join the graph.
fn alone(mut network: NetworkFacts, error: &str) -> Facts {
    network.error = Some(error.to_owned());
    let is_on_subnet = network.is_dds() && network.range == Range::Subnet;
    Facts {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        machine: Machine {
            interfaces: machine::interfaces(),
            multicast_error: is_on_subnet.then(machine::multicast_error).flatten(),
            rmem_max: machine::rmem_max(),
            processes: processes::in_domains(),
            ..Machine::default()
        },
        network,
        ..Facts::default()
    }
}

/// Collects all facts, in a few seconds.
fn collect(node: &Node, network: NetworkFacts) -> CliResult<Facts> {
    let is_on_subnet = network.is_dds() && network.range == Range::Subnet;
    let announcements = is_on_subnet.then(|| Announcements::listen(network.domain));
    // Begins to listen to the names of nodes.
    node.remote_endpoints();
    let begin = Instant::now();
    let multicast_error = is_on_subnet.then(machine::multicast_error).flatten();
    thread::sleep(DISCOVERY.saturating_sub(begin.elapsed()));
    let endpoints = || -> Vec<Endpoint> {
        let all = node.remote_endpoints();
        all.into_iter().map(Endpoint::from).collect()
    };
    let messages = Messages::subscribe(node, &endpoints())?;
    thread::sleep(RECEPTION);
    let (endpoints, time) = (endpoints(), messages.facts());
    let processes = processes::in_domains();
    let here = processes.iter().filter(|of| of.domain == network.domain);
    let folders: Vec<&Path> = here.filter_map(|of| of.folder.as_deref()).collect();
    Ok(Facts {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        map_dirs: map_dirs(node, &endpoints, &folders),
        machine: Machine {
            interfaces: machine::interfaces(),
            multicast_error,
            rmem_max: machine::rmem_max(),
            processes,
            other_domains: announcements.map_or_else(Default::default, |of| of.senders()),
        },
        network,
        endpoints,
        time,
    })
}

/// Folders of the maps of all nodes that save maps; relative ones are looked up in `folders`.
fn map_dirs(node: &Node, endpoints: &[Endpoint], folders: &[&Path]) -> Vec<MapDir> {
    let savers = endpoints
        .iter()
        .filter(|of| of.role == GraphRole::Server && of.topic.ends_with("/save_map"));
    let nodes: BTreeSet<&str> = savers.map(|of| of.node.as_str()).collect();
    let end = Instant::now() + ANSWERS;
    let folder = |name: &&str| {
        let patience = end.saturating_duration_since(Instant::now());
        let path = map_dir(node, name, patience)?;
        // Relative to the working directory of its process.
        let candidates: Vec<PathBuf> = match path.is_absolute() {
            true => vec![path.clone()],
            false => folders.iter().map(|folder| folder.join(&path)).collect(),
        };
        let free = candidates
            .iter()
            .filter_map(|path| machine::free_bytes(path));
        Some(MapDir {
            node: (*name).to_owned(),
            free_bytes: free.min(),
            path,
        })
    };
    nodes.iter().filter_map(folder).collect()
}

/// Parameter `map_dir` of a node.
fn map_dir(node: &Node, name: &str, patience: Duration) -> Option<PathBuf> {
    let client = node.client::<GetParameters>(&format!("{name}/get_parameters"));
    let request = GetParametersRequest {
        names: vec!["map_dir".to_owned()],
    };
    let request = cdr::to_vec(&request).ok()?;
    let reply = client.ok()?.call_blocking(request, patience).ok()?;
    let reply: GetParametersResponse = cdr::from_slice(&reply).ok()?;
    let value = reply.values.into_iter().next()?.string_value;
    (!value.is_empty()).then(|| value.into())
}
