//! `lattice health`: health of nodes by their messages on `/diagnostics`.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use clap::Args;
use lattice_msgs::diagnostic_msgs::{DiagnosticArray, DiagnosticStatus};
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Runtime, SubscriptionExecutor, WORKING};

use super::{CliResult, init_logging};

/// Name of the querying node.
const NAME: &str = "lattice_health";

/// Fail unless nodes are running and healthy, by their diagnostics
///
/// A node is unhealthy if one of its tasks is ERROR or STALE, or WARN with the value `working: false`, such as a mapper
/// before its first cloud. Other warnings are printed.
#[derive(Args)]
pub struct Health {
    /// Full names of nodes, such as `lattice_mapper` or `robot/lattice_mapper`; by default all nodes
    /// that publish on /diagnostics
    nodes: Vec<String>,
    /// Timeout, s; nodes publish once a second
    #[arg(long, default_value_t = 5.0, value_name = "S")]
    timeout: f64,
    /// As for any ROS node: `-- --ros-args -r /diagnostics:=/robot/diagnostics ...`
    #[arg(last = true)]
    ros_args: Vec<String>,
}

/// Discovery time if no node is named; each running node has published by then.
const FINDING: Duration = Duration::from_millis(1500);

/// Highest level of each task of each node in its last message.
type Tasks = BTreeMap<String, DiagnosticStatus>;

impl Health {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        init_logging();
        let timeout = Duration::try_from_secs_f64(self.timeout);
        let timeout = timeout.map_err(|error| format!("--timeout: {error}"))?;
        let quiet = ["--ros-args", "--disable-rosout-logs"].map(str::to_owned);
        let args = RosArgs::parse(self.ros_args.iter().cloned().chain(quiet))?;
        let runtime = Runtime::start(NAME, args)?;
        let node = runtime.node(NAME)?;
        let (sender, heard) = channel();
        let handler = move |message| drop(sender.send(message));
        let _subscription = node.subscribe::<DiagnosticArray>(
            "/diagnostics",
            Qos::DIAGNOSTICS,
            SubscriptionExecutor::Shared,
            handler,
        )?;
        let deadline = Instant::now()
            .checked_add(timeout)
            .ok_or("--timeout is too long")?;
        let found = match self.nodes.is_empty() {
            true => deadline.min(Instant::now() + FINDING),
            false => Instant::now(),
        };
        let topic = node.resolve("/diagnostics")?;
        let publishers = || {
            let all = node.remote_publishers();
            all.iter().filter(|of| of.topic == topic).count()
        };
        let (mut tasks, mut sources) = (Tasks::new(), BTreeSet::new());
        loop {
            let now = Instant::now();
            let until = if now < found { found } else { deadline };
            match heard.recv_timeout(until.saturating_duration_since(now)) {
                Ok(message) => {
                    tasks.extend(others(&message));
                    let first = message.status.first().map(|status| &status.name);
                    sources.extend(first.filter(|name| node_of(name) != NAME).cloned());
                }
                Err(RecvTimeoutError::Timeout) if until < deadline => {}
                Err(RecvTimeoutError::Timeout) => break,
                Err(RecvTimeoutError::Disconnected) => return Err("the subscription ended".into()),
            }
            let all = !self.nodes.is_empty() || sources.len() >= publishers();
            if all && Instant::now() >= found && self.silent(&tasks).is_empty() {
                return self.judge(&tasks);
            }
        }
        let silent = publishers().saturating_sub(sources.len());
        if self.nodes.is_empty() && silent > 0 {
            eprintln!(
                "{silent} publishers of {topic} have published nothing in {} s",
                self.timeout
            );
        }
        self.judge(&tasks)
    }

    /// Nodes without a message.
    fn silent(&self, tasks: &Tasks) -> Vec<String> {
        if self.nodes.is_empty() {
            return match tasks.is_empty() {
                true => vec!["every node".to_owned()],
                false => Vec::new(),
            };
        }
        let speaks = |node: &str| tasks.keys().any(|task| node_of(task) == node);
        let nodes = self.nodes.iter().map(|node| node.trim_start_matches('/'));
        let silent = nodes.filter(|node| !speaks(node));
        silent.map(str::to_owned).collect()
    }

    fn judge(&self, tasks: &Tasks) -> CliResult {
        let silent = self.silent(tasks);
        if !silent.is_empty() {
            return Err(format!(
                "no diagnostics from {} in {} s",
                silent.join(", "),
                self.timeout
            )
            .into());
        }
        let named = |task: &str| {
            let is = |node: &String| node.trim_start_matches('/') == node_of(task);
            self.nodes.is_empty() || self.nodes.iter().any(is)
        };
        let mut ill = Vec::new();
        for (task, status) in tasks.iter().filter(|(task, _)| named(task)) {
            println!("{} {task}: {}", level(status.level), status.message);
            if !is_well(status) {
                ill.push(task.as_str());
            }
        }
        match ill.is_empty() {
            true => Ok(()),
            false => Err(format!("unhealthy: {}", ill.join(", ")).into()),
        }
    }
}

/// Statuses in a message, except our own.
fn others(message: &DiagnosticArray) -> impl Iterator<Item = (String, DiagnosticStatus)> {
    let others = message
        .status
        .iter()
        .filter(|status| node_of(&status.name) != NAME);
    others.map(|status| (status.name.clone(), status.clone()))
}

/// Node of a task, which is named `node: task`.
fn node_of(task: &str) -> &str {
    task.split_once(": ").map_or(task, |(node, _)| node)
}

/// False for a task that fails, or cannot do its work yet.
fn is_well(status: &DiagnosticStatus) -> bool {
    let working = || status.values.iter().find(|value| value.key == WORKING);
    match status.level {
        DiagnosticStatus::OK => true,
        DiagnosticStatus::WARN => working().is_none_or(|value| value.value != "false"),
        _ => false,
    }
}

fn level(level: u8) -> &'static str {
    match level {
        DiagnosticStatus::OK => "OK",
        DiagnosticStatus::WARN => "WARN",
        DiagnosticStatus::ERROR => "ERROR",
        _ => "STALE",
    }
}
