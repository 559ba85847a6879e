//! `lattice run`: several nodes in one process.

use std::path::PathBuf;

use clap::Args;

use super::CliResult;
use lattice_nodes::executables;
use lattice_nodes::running::Running;
use lattice_runtime::params_file;
use lattice_runtime::ros_args::RosArgs;

/// Run several nodes in one process
#[derive(Args)]
pub struct Run {
    /// Parameter files; the nodes that they name are run
    #[arg(required = true)]
    params: Vec<PathBuf>,
    /// Nodes to run, when the files name others too
    #[arg(long, value_name = "NODE")]
    only: Vec<String>,
    /// As for any ROS node: `--ros-args -r from:=to -p name:=value ...`
    #[arg(last = true)]
    ros_args: Vec<String>,
    /// Nodes that run whatever the files name.
    #[arg(skip)]
    always: &'static [&'static str],
}

impl Run {
    /// Runs the nodes that parameter files name, and some others.
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
        if nodes.is_empty() {
            let known: Vec<&str> = executables::NODES.iter().map(|(name, _)| *name).collect();
            return Err(format!(
                "the parameter files name none of the nodes {}",
                known.join(", ")
            )
            .into());
        }
        let runtime = executables::start_runtime("lattice", RosArgs::parse(arguments)?)?;
        // The node of the process itself has only the parameters of every node.
        runtime.node("lattice")?.params().open(|_| Ok(()));
        let mut running = Running::default();
        for (name, start) in nodes {
            running.start(&runtime, name, *start, executables::reader_of(name))?;
        }
        running.until_stopped(&runtime)
    }
}
