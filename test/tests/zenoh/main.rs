//! Nodes and runtime over Zenoh, against foreign peers. Tests of every transport run over it too: `.ci/zenoh`.
#![allow(clippy::unwrap_used)]

mod actions;
mod foreign;
mod mapping;
mod ros2_client;
mod router;
mod scouting;

use std::io::{BufRead, BufReader, Write};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use lattice_msgs::RosMessage;
use lattice_msgs::std_msgs::String as RosString;
use lattice_runtime::env::{Network, TransportKind, ZenohSettings};
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Node, Runtime, Subscription, SubscriptionExecutor};
use lattice_test::domain::TestDomain;
use lattice_test::python::script;

/// Long enough for a loaded machine; a test that passes does not wait for it.
const PATIENCE: Duration = Duration::from_secs(60);

/// A process with Zenoh, which ends with its input.
struct Peer {
    child: Child,
    output: BufReader<std::process::ChildStdout>,
}

impl Peer {
    /// The script of the peer in Python.
    fn start(python: &Path, args: &[&str]) -> Self {
        Self::spawn(Command::new(python).arg(script("zenoh_peer.py")).args(args))
    }

    fn spawn(command: &mut Command) -> Self {
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let output = BufReader::new(child.stdout.take().unwrap());
        Self { child, output }
    }

    /// Writes a line to its input and returns the next line that it prints, without its end.
    fn ask(&mut self, line: &str) -> String {
        writeln!(self.child.stdin.as_mut().unwrap(), "{line}").unwrap();
        self.line().trim_end().to_owned()
    }

    /// The next line that it prints.
    fn line(&mut self) -> String {
        let mut line = String::new();
        self.output.read_line(&mut line).unwrap();
        assert!(!line.is_empty(), "the peer has ended");
        line
    }

    fn finish(mut self) {
        drop(self.child.stdin.take());
        assert!(self.child.wait().unwrap().success());
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A router of PyPI's Zenoh, and a domain.
struct Site {
    endpoint: String,
    domain: TestDomain,
    _router: Peer,
}

impl Site {
    fn start(python: &Path) -> Self {
        let endpoint = free_endpoint();
        let mut router = Peer::start(python, &["router", &endpoint]);
        assert_eq!(router.line(), "ready\n");
        Self {
            endpoint,
            domain: TestDomain::take(),
            _router: router,
        }
    }

    fn network(&self) -> Network {
        let overrides = format!("connect/endpoints=[\"{}\"]", self.endpoint);
        network(&self.domain, &overrides, "0")
    }

    fn runtime(&self, name: &str) -> Runtime {
        runtime(name, &[], &self.network())
    }
}

/// An endpoint on loopback where nobody listens.
fn free_endpoint() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    format!("tcp/{}", listener.local_addr().unwrap())
}

fn network(domain: &TestDomain, overrides: &str, router_check: &str) -> Network {
    Network {
        domain_id: domain.id(),
        transport: TransportKind::Zenoh,
        zenoh: ZenohSettings {
            session_config: None,
            overrides: Some(overrides.to_owned()),
            router_check: Some(router_check.to_owned()),
        },
        ..Network::from_env().unwrap()
    }
}

fn runtime(name: &str, params: &[&str], network: &Network) -> Runtime {
    let params = params.iter().flat_map(|param| ["-p", param]);
    let args = ["--ros-args"].into_iter().chain(params).map(str::to_owned);
    Runtime::with_transport(name, RosArgs::parse(args).unwrap(), network).unwrap()
}

/// Messages of a topic, in a channel.
fn hear<M: RosMessage>(node: &Node, topic: &str, qos: Qos) -> (Subscription, Receiver<Arc<M>>) {
    let (sender, receiver) = channel();
    let handler = move |message| {
        // The test may have heard enough.
        let _ = sender.send(message);
    };
    let subscription = node.subscribe::<M>(topic, qos, SubscriptionExecutor::Shared, handler);
    (subscription.unwrap(), receiver)
}

fn text(data: impl ToString) -> RosString {
    RosString {
        data: data.to_string(),
    }
}
