//! `lattice run`: several nodes in one process.

use std::env;
use std::ffi::OsStr;
use std::io;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::path::PathBuf;

use clap::Args;

use super::CliResult;
use lattice_nodes::executables::{self, Files};
use lattice_nodes::running::Running;
use lattice_runtime::params::nearest;
use lattice_runtime::params_file;
use lattice_runtime::ros_args::RosArgs;

/// Name of the node of the process itself.
const PROCESS: &str = "lattice";

/// Run several nodes in one process
#[derive(Args)]
pub struct Run {
    /// Parameter files; the nodes named in them are run
    #[arg(required = true)]
    params: Vec<PathBuf>,
    /// Nodes to run, of those named in the files
    #[arg(long, value_name = "NODE")]
    only: Vec<String>,
    /// As for any ROS node: `--ros-args -r from:=to -p name:=value ...`
    #[arg(last = true)]
    ros_args: Vec<String>,
    /// Nodes that always run.
    #[arg(skip)]
    always: &'static [&'static str],
}

impl Run {
    /// Nodes named in parameter files, and those that always run.
    #[cfg(feature = "viewer")]
    pub fn nodes_of(
        params: Vec<PathBuf>,
        always: &'static [&'static str],
        ros_args: Vec<String>,
    ) -> Self {
        Self {
            params,
            only: Vec::new(),
            ros_args,
            always,
        }
    }

    /// Runs the command.
    pub fn run(self) -> CliResult {
        let mut arguments = vec!["--ros-args".to_owned()];
        let mut named = Vec::new();
        for only in &self.only {
            if !known().any(|name| name == only) {
                return Err(unknown_node(only).into());
            }
        }
        for file in &self.params {
            named.extend(
                params_file::read(file)?
                    .into_iter()
                    .map(|param| param.nodes),
            );
            arguments.extend(["--params-file".to_owned(), file.display().to_string()]);
        }
        arguments.push("--".to_owned());
        arguments.extend(self.ros_args);
        let wanted = |name: &str| {
            let named = named.iter().any(|pattern| pattern.names(name));
            self.always.contains(&name)
                || named && (self.only.is_empty() || self.only.iter().any(|only| only == name))
        };
        let nodes: Vec<_> = executables::NODES
            .iter()
            .filter(|(name, _)| wanted(name))
            .collect();
        let args = RosArgs::parse(arguments)?;
        if nodes.is_empty() {
            executables::check_names(&args, &[], Files::Own)?;
            let known = known().collect::<Vec<_>>().join(", ");
            return Err(format!("the parameter files name none of the nodes {known}").into());
        }
        // The node of the process itself has common parameters only.
        let checked = nodes
            .iter()
            .map(|(name, _)| (*name, executables::reader_of(name)));
        let checked: Vec<_> = checked.chain([(PROCESS, None)]).collect();
        let runtime = executables::start_runtime(PROCESS, args, &checked, Files::Own)?;
        runtime.node(PROCESS)?.params().open(|_| Ok(()));
        let mut running = Running::default();
        for (name, start) in nodes {
            running.start(&runtime, name, *start, executables::reader_of(name))?;
        }
        if let Some(manager) = env::var_os("NOTIFY_SOCKET") {
            // The variable may be of a service whose socket is not reached from here, as in a container.
            if let Err(error) = ready(&manager) {
                log::warn!(
                    "the service manager does not learn that the nodes have started: NOTIFY_SOCKET={}: {error}",
                    manager.display()
                );
            }
        }
        running.until_stopped(&runtime)
    }
}

/// Reports to the service manager that the nodes have started (sd_notify). A name with `@` is an abstract one.
fn ready(manager: &OsStr) -> io::Result<()> {
    let address = match manager.as_bytes() {
        [b'@', name @ ..] => SocketAddr::from_abstract_name(name)?,
        _ => SocketAddr::from_pathname(manager)?,
    };
    UnixDatagram::unbound()?
        .send_to_addr(b"READY=1", &address)
        .map(drop)
}

/// Names of the nodes that can share a process.
fn known() -> impl Iterator<Item = &'static str> {
    executables::NODES.iter().map(|(name, _)| *name)
}

fn unknown_node(name: &str) -> String {
    match nearest(name, known()) {
        Some((near, _)) => format!("no node '{name}' (`--only`); did you mean '{near}'?"),
        None => {
            let known = known().collect::<Vec<_>>().join(", ");
            format!("no node '{name}' (`--only`), expected one of {known}")
        }
    }
}
