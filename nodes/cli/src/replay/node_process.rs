//! A node in a separate process.

use std::collections::BTreeSet;
use std::error::Error;
use std::io::{self, BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use crossbeam_channel::{Receiver, Sender, unbounded};

use super::dds_replay::{DdsReplay, param, yaml_text};
use crate::CliResult;
use lattice_nodes::report;
use lattice_runtime::LoopbackDomain;

/// Setting named in a warning about a short receive buffer.
const BUFFER_SETTING: &str = "net.core.rmem_max";
/// Such a warning of a node; it is shown after a loss.
static SHORT_BUFFER: Mutex<Option<String>> = Mutex::new(None);
/// Limit of stored warning texts.
const MAX_TEXTS: usize = 1000;
/// Discovery timeout, also for a busy machine.
const MATCH_TIME: Duration = Duration::from_secs(60);
/// Timeout for a node to process its inbox at its end.
const END_TIME: Duration = Duration::from_secs(300);

/// A node in a separate process, and its log.
pub struct NodeProcess {
    name: String,
    child: Child,
    lines: Receiver<String>,
    seen: Vec<String>,
    reader: Option<JoinHandle<()>>,
    report: PathBuf,
}

impl NodeProcess {
    /// Starts a node, or several, separated by commas, in one process.
    pub fn start(
        node: &str,
        namespace: Option<&str>,
        params: &[String],
        remaps: &[String],
        replay: &DdsReplay,
        report: &Path,
    ) -> CliResult<Self> {
        let mut command = Command::new(std::env::current_exe()?);
        let nodes: Vec<&str> = node.split(',').collect();
        let files = &replay.options.params;
        if let [node] = nodes.as_slice() {
            command.args(["node", node, "--ros-args"]);
            for file in files {
                command.arg("--params-file").arg(file);
            }
        } else {
            command.arg("run").args(files);
            for node in &nodes {
                command.args(["--only", node]);
            }
            command.args(["--", "--ros-args"]);
        }
        command.args(["--log-level", "info"]);
        if let Some(namespace) = namespace {
            command.args(["-r", &format!("__ns:=/{namespace}")]);
            for shared in ["points_enu", "map_origin"] {
                command.args(["-r", &format!("{shared}:=/{shared}")]);
            }
        }
        for remap in replay.remaps().iter().chain(remaps) {
            command.args(["-r", remap]);
        }
        // The first of several nodes writes the report.
        let first = nodes.first().copied().unwrap_or_default();
        let report_file = param(&format!("{first}:report_file"), &yaml_text(report));
        let given = replay.options.params_for(&nodes)?;
        for param in given.iter().chain(params).chain([&report_file]) {
            command.args(["-p", param]);
        }
        let what = match namespace {
            Some(namespace) => format!("{namespace}/{node}"),
            None => node.to_owned(),
        };
        Self::spawn(command, what, &replay.domain, report)
    }

    /// Starts a command that runs nodes, one of which writes this report, on a loopback domain, regardless of the domain
    /// and peers in the environment.
    pub fn spawn(
        mut command: Command,
        what: String,
        domain: &LoopbackDomain,
        report: &Path,
    ) -> CliResult<Self> {
        command
            .env("ROS_DOMAIN_ID", domain.id().to_string())
            .env_remove("ROS_STATIC_PEERS")
            .env_remove("ROS_LOCALHOST_ONLY")
            .env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        let spawned = command.spawn();
        let mut child = spawned.map_err(|error| format!("cannot start {what}: {error}"))?;
        let (sender, lines) = unbounded();
        let stderr = child.stderr.take();
        let reader = stderr.map(|stderr| forward(stderr, what.clone(), sender));
        Ok(Self {
            name: what,
            child,
            lines,
            seen: Vec::new(),
            reader,
            report: report.to_owned(),
        })
    }

    /// Waits until the node has logged a line with this text, and returns the line.
    pub fn expect(&mut self, text: &str) -> CliResult<String> {
        let deadline = Instant::now() + MATCH_TIME;
        loop {
            if let Some(line) = self.seen.iter().find(|line| line.contains(text)) {
                return Ok(line.clone());
            }
            match self.lines.recv_deadline(deadline) {
                Ok(line) => self.seen.push(line),
                Err(_) => {
                    if let Some(status) = self.child.try_wait()? {
                        return Err(self.ended(status));
                    }
                    warn_of_short_buffer();
                    return Err(format!(
                        "{} did not log '{text}' within {} s: is the loopback interface up, and \
                         its domain used by nothing else?",
                        self.name,
                        MATCH_TIME.as_secs()
                    )
                    .into());
                }
            }
        }
    }

    /// Waits for the end of the player; reports its progress.
    pub fn played(mut self, progress: &mut dyn FnMut(f64)) -> CliResult {
        while let Ok(line) = self.lines.recv() {
            let share = line.rsplit_once("played ").map(|(_, share)| share);
            let share = share.and_then(|share| share.trim_end_matches(" %").parse::<f64>().ok());
            if let Some(share) = share {
                progress(share / 100.0);
            }
            self.seen.push(line);
        }
        let status = self.child.wait()?;
        if status.success() {
            Ok(())
        } else {
            Err(self.ended(status))
        }
    }

    /// Ends the node, waits for it, and reads its report.
    pub fn end<T: for<'de> serde::Deserialize<'de>>(mut self) -> CliResult<T> {
        interrupt(&self.child)?;
        let deadline = Instant::now() + END_TIME;
        // The log ends with the process.
        loop {
            match self.lines.recv_deadline(deadline) {
                Ok(line) => self.seen.push(line),
                Err(error) if error.is_timeout() => {
                    let limit_s = END_TIME.as_secs();
                    return Err(format!(
                        "{} did not end within {limit_s} s of SIGINT, so its report is missing",
                        self.name
                    )
                    .into());
                }
                Err(_) => break,
            }
        }
        let status = self.child.wait()?;
        if !status.success() {
            return Err(self.ended(status));
        }
        let read = report::read(&self.report);
        read.map_err(|error| format!("no report of {}: {error}", self.name).into())
    }

    fn ended(&mut self, status: ExitStatus) -> Box<dyn Error + Send + Sync> {
        self.seen.extend(self.lines.try_iter());
        let words = self.seen.last().map_or("", String::as_str);
        format!("{} ended with {status}; last log line: {words}", self.name).into()
    }
}

impl Drop for NodeProcess {
    /// Ends the process if a replay fails.
    fn drop(&mut self) {
        if let Ok(None) = self.child.try_wait() {
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
        if let Some(reader) = self.reader.take() {
            let _ = reader.join();
        }
    }
}

/// Forwards the log of a node: warnings to our own log.
fn forward(
    stderr: impl io::Read + Send + 'static,
    name: String,
    lines: Sender<String>,
) -> JoinHandle<()> {
    thread::spawn(move || {
        for line in BufReader::new(stderr).lines().map_while(Result::ok) {
            // Warnings of several processes on one machine are shown once.
            let text = line.rsplit_once("]: ").map_or(&*line, |(_, text)| text);
            let warning = line.contains("[WARN]") || line.contains("[ERROR]");
            // The player starts after discovery.
            let expected = text.starts_with("no publisher on ");
            if warning && text.contains(BUFFER_SETTING) {
                let mut kept = SHORT_BUFFER.lock().unwrap_or_else(PoisonError::into_inner);
                *kept = Some(text.to_owned());
            } else if warning && !expected && first_time(text) {
                log::warn!("{name}: {text}");
            } else {
                log::debug!("{name}: {line}");
            }
            if lines.send(line).is_err() {
                break;
            }
        }
    })
}

/// Logs a node's warning about its receive buffer, after a loss.
pub fn warn_of_short_buffer() {
    let kept = SHORT_BUFFER.lock();
    if let Some(text) = kept.unwrap_or_else(PoisonError::into_inner).take() {
        log::warn!("{text}");
    }
}

/// True if no process has logged this text before.
fn first_time(text: &str) -> bool {
    static SEEN: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
    let mut seen = SEEN.lock().unwrap_or_else(PoisonError::into_inner);
    seen.len() >= MAX_TEXTS || seen.insert(text.to_owned())
}

/// Sends SIGINT.
fn interrupt(child: &Child) -> io::Result<()> {
    let pid = rustix::process::Pid::from_child(child);
    Ok(rustix::process::kill_process(
        pid,
        rustix::process::Signal::INT,
    )?)
}
