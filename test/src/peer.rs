//! Nodes of ours, each with a participant of its own, and a peer in Python of CycloneDDS.

use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Lines};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};

use lattice_nodes::executables;
use lattice_nodes::start::Finish;
use lattice_runtime::Runtime;
use lattice_runtime::env::Network;
use lattice_runtime::ros_args::RosArgs;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::domain::TestDomain;
use crate::python::script;

/// Nodes at work, in the order in which data flows.
pub struct Nodes(Vec<(Runtime, Finish)>);

impl Nodes {
    /// Starts nodes with their parameters, each with a participant of its own.
    pub fn start(domain: &TestDomain, nodes: &[(&str, Vec<String>)]) -> Self {
        Self::start_on(&domain.transport(), nodes)
    }

    /// The same on a network.
    pub fn start_on(network: &Network, nodes: &[(&str, Vec<String>)]) -> Self {
        let start = |(name, params): &(&str, Vec<String>)| {
            let params = params.iter().flat_map(|param| ["-p", param]);
            let args = ["--ros-args"].into_iter().chain(params).map(str::to_owned);
            let args = RosArgs::parse(args).unwrap();
            let runtime = Runtime::with_transport(name, args, network).unwrap();
            let finish = executables::find(name).unwrap()(&runtime, name).unwrap();
            (runtime, finish)
        };
        Self(nodes.iter().map(start).collect())
    }

    /// Ends them, the first one first.
    pub fn finish(self) {
        for (runtime, finish) in self.0 {
            finish();
            drop(runtime);
        }
    }
}

/// Parameters separated by blanks.
pub fn params(line: &str) -> Vec<String> {
    line.split_whitespace().map(str::to_owned).collect()
}

/// A script of the peer at work, which ends when this is dropped.
pub struct Script {
    child: Child,
    lines: Lines<BufReader<ChildStdout>>,
}

impl Script {
    /// Starts a script.
    pub fn start<A: AsRef<OsStr>>(
        python: &Path,
        name: &str,
        args: impl IntoIterator<Item = A>,
    ) -> Self {
        let mut command = Command::new(python);
        command.arg(script(name)).args(args).stdout(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        Self { child, lines }
    }

    /// The next line that it prints.
    pub fn line<T: DeserializeOwned>(&mut self) -> T {
        serde_json::from_str(&self.lines.next().unwrap().unwrap()).unwrap()
    }
}

impl Drop for Script {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Runs a script of the peer to its end and reads the line that it prints.
pub fn run(python: &Path, name: &str, args: &[&Path]) -> Value {
    let mut command = Command::new(python);
    command
        .arg(script(name))
        .args(args)
        .stderr(Stdio::inherit());
    let output = command.output().unwrap();
    assert!(output.status.success(), "{name}: {}", output.status);
    serde_json::from_slice(&output.stdout).unwrap()
}
