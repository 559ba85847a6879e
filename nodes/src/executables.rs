//! Executables: the table of nodes, a runtime for one or several of them, an orderly end.

mod names;
mod table;

pub use names::{Files, NamedNode, check_names};
pub use table::{NODES, PARAMETERS, find, reader_of};

use std::io::{Write, stdout};
use std::process::ExitCode;

use crate::running::Running;
use crate::start::{Declare, NodeError, Start};
use lattice_runtime::Runtime;
use lattice_runtime::logging;
use lattice_runtime::params::Params;
use lattice_runtime::ros_args::RosArgs;

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
