//! Executables: the table of nodes, a runtime for one or several of them, an orderly end.

mod names;

pub use names::{Files, NamedNode, check_names};

use std::io::{Write, stdout};
use std::process::ExitCode;

#[cfg(feature = "headset")]
use crate::headset_cloud;
use crate::running::Running;
use crate::start::{Declare, NodeError, Start};
#[cfg(feature = "viewer")]
use crate::viewer_server;
use crate::{
    enu_transformer, lattice_mapper, lidar_odometry, map_merger, map_projector, segmenter,
    semantic_cloud, semantic_icp_server, voxel_marker_publisher,
};
use lattice_runtime::Runtime;
use lattice_runtime::logging;
use lattice_runtime::params::Params;
use lattice_runtime::ros_args::RosArgs;

/// Every node that can share a process, in the order in which data flows.
pub const NODES: &[(&str, Start)] = &[
    ("segmenter", segmenter::node::start),
    ("semantic_cloud", semantic_cloud::node::start),
    #[cfg(feature = "headset")]
    ("headset_cloud", headset_cloud::node::start),
    ("lidar_odometry", lidar_odometry::node::start),
    ("enu_transformer", enu_transformer::node::start),
    ("lattice_mapper", lattice_mapper::node::start),
    ("map_merger", map_merger::node::start),
    ("map_projector", map_projector::node::start),
    (
        "voxel_marker_publisher",
        voxel_marker_publisher::node::start,
    ),
    ("semantic_icp_server", semantic_icp_server::node::start),
    #[cfg(feature = "viewer")]
    ("viewer_server", viewer_server::node::start),
];

/// Readers of the parameters of those nodes.
pub const PARAMETERS: &[(&str, Declare)] = &[
    ("segmenter", segmenter::declare),
    ("semantic_cloud", semantic_cloud::declare),
    #[cfg(feature = "headset")]
    ("headset_cloud", headset_cloud::declare),
    ("lidar_odometry", lidar_odometry::declare),
    ("enu_transformer", enu_transformer::declare),
    ("lattice_mapper", lattice_mapper::declare),
    ("map_merger", map_merger::declare),
    ("map_projector", map_projector::declare),
    ("voxel_marker_publisher", voxel_marker_publisher::declare),
    ("semantic_icp_server", semantic_icp_server::declare),
    #[cfg(feature = "viewer")]
    ("viewer_server", viewer_server::declare),
];

/// Finds the node of an executable name.
pub fn find(name: &str) -> Option<Start> {
    let found = NODES.iter().find(|(node, _)| *node == name);
    found.map(|(_, start)| *start)
}

/// Finds the reader of the parameters of an executable.
pub fn reader_of(name: &str) -> Option<Declare> {
    let found = PARAMETERS.iter().find(|(node, _)| *node == name);
    found.map(|(_, declare)| *declare)
}

/// Runs one node until a signal stops it. `arguments` are those of the command line.
pub fn run(
    name: &str,
    start: Start,
    arguments: impl IntoIterator<Item = String>,
) -> Result<(), NodeError> {
    let args = RosArgs::parse(arguments)?;
    let declare = reader_of(name);
    if answers_help(name, declare, &args) {
        return Ok(());
    }
    let runtime = start_runtime(name, args, &[(name, declare)], Files::Shared)?;
    let mut running = Running::default();
    running.start(&runtime, name, start, declare)?;
    running.until_stopped(&runtime)
}

/// Prints how an executable is used, and its parameters, if its arguments ask for it.
pub fn answers_help(name: &str, declare: Option<Declare>, args: &RosArgs) -> bool {
    let asked = args
        .user_args
        .iter()
        .any(|arg| arg == "--help" || arg == "-h");
    if asked {
        let mut text = format!(
            "Usage: {name} [--ros-args [-r FROM:=TO] [-p NAME:=VALUE] [--params-file FILE] \
             [--log-level LEVEL] [--enclave NAME] ...]\n\n\
             Topics and services are in README.md.\n\n\
             Environment: ROS_DOMAIN_ID, ROS_AUTOMATIC_DISCOVERY_RANGE (LOCALHOST or SUBNET),\n\
             ROS_STATIC_PEERS, CYCLONEDDS_URI, ROS_SECURITY_ENABLE with the others of SROS2\n\
             (docs/security.md), RUST_LOG.\n"
        );
        let params = Params::from_values(name, std::iter::empty::<(String, _)>());
        if declare.is_some_and(|declare| declare(&params).is_ok()) {
            text += "\nParameters; those that are not [fixed] can be set while the node runs:\n\n";
            text += &params.help();
        }
        // Who reads it may have seen enough.
        let _ = stdout().write_all(text.as_bytes());
    }
    asked
}

/// Log lines as ROS users know them, and a runtime, unless a name is given that none of the nodes knows.
pub fn start_runtime(
    name: &str,
    args: RosArgs,
    nodes: &[NamedNode<'_>],
    files: Files,
) -> Result<Runtime, NodeError> {
    if let Err(error) = logging::init(&args, &args.node_name(name)) {
        eprintln!("{name}: another logger is in place: {error}");
    }
    // The first is the program where a caller passes it along.
    for unknown in args.user_args.iter().filter(|arg| arg.starts_with('-')) {
        log::warn!("argument '{unknown}' has no meaning here; ROS arguments follow --ros-args");
    }
    check_names(&args, nodes, files)?;
    Ok(Runtime::start(name, args)?)
}

/// The whole `main` of an executable that is one node.
pub fn main(name: &str, start: Start) -> ExitCode {
    match run(name, start, std::env::args().skip(1)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{name}: {error}");
            ExitCode::FAILURE
        }
    }
}
