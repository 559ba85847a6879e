//! Replay over DDS: the player and one process for each node, on a loopback domain of their own.

use std::collections::BTreeSet;
use std::io::{self, BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use crossbeam_channel::{Receiver, Sender, unbounded};
use lattice_core::lattice::Lattice;
use thiserror::Error;

use super::{LoopbackDomain, Role, TopicPlan};
use crate::bag::BagReader;
use crate::report::{self, LatticeReport, RunReport};

/// Texts of warnings that are remembered.
const MAX_TEXTS: usize = 1000;
/// Time for all nodes to find each other.
const MATCH_TIME: Duration = Duration::from_secs(30);
/// Time for a node to work off its inbox when told to end.
const END_TIME: Duration = Duration::from_secs(60);

/// Why a replay over DDS failed.
#[derive(Debug, Error)]
pub enum ProcessError {
    /// A process did not start.
    #[error("cannot start {what}: {error}")]
    Start {
        /// Node.
        what: String,
        /// Reason.
        error: io::Error,
    },
    /// A process ended by itself.
    #[error("{what} ended with {status}; its last words: {words}")]
    Ended {
        /// Node.
        what: String,
        /// Status.
        status: ExitStatus,
        /// Last line of its log.
        words: String,
    },
    /// The nodes did not find each other.
    #[error("{what} did not log '{waited}' within {} s: is the loopback interface up, and its domain used by nothing else?", MATCH_TIME.as_secs())]
    NotMatched {
        /// Node.
        what: String,
        /// Line waited for.
        waited: String,
    },
    /// A node did not end when told to.
    #[error("{what} did not end within {} s", END_TIME.as_secs())]
    Stuck {
        /// Node.
        what: String,
    },
    /// A node left no report.
    #[error("no report of {what}: {error}")]
    NoReport {
        /// Node.
        what: String,
        /// Reason.
        error: io::Error,
    },
    /// Files.
    #[error("{0}")]
    Io(#[from] io::Error),
}

/// What is to be replayed and how.
pub struct DdsReplay<'a> {
    /// The log.
    pub bag: &'a Path,
    /// The same, open.
    pub reader: &'a BagReader,
    /// Roles of its topics.
    pub plan: &'a TopicPlan,
    /// One map for each.
    pub lattices: Vec<Lattice>,
    /// Parameter files of the nodes.
    pub params_files: &'a [PathBuf],
    /// Further parameters, `name:=value`.
    pub params: &'a [String],
    /// Speed, 1 is real time.
    pub rate: f64,
    /// Domain of the processes; `None`: that of `ROS_DOMAIN_ID`.
    pub domain: Option<LoopbackDomain>,
}

/// Plays the log through separate processes and collects what they report.
pub fn run(
    replay: &DdsReplay,
    progress: &mut dyn FnMut(f64, &str),
) -> Result<RunReport, ProcessError> {
    let scratch = tempfile::tempdir()?;
    let begin = Instant::now();
    progress(0.0, "nodes find each other");
    let mut branches = Vec::new();
    for lattice in &replay.lattices {
        branches.push(Branch::start(replay, lattice, scratch.path())?);
    }
    let mut transformer = NodeProcess::start(
        "enu_transformer",
        &replay.transformer_arguments(),
        replay,
        &scratch.path().join("enu_transformer.json"),
    )?;
    for branch in &mut branches {
        branch.matched()?;
    }
    transformer.expect(&format!(
        "/points_enu: subscriber matched ({})",
        branches.len()
    ))?;
    let player = NodeProcess::start(
        "bag_player",
        &replay.player_arguments(),
        replay,
        &scratch.path().join("bag_player.json"),
    )?;
    player.played(&mut |done| progress(done, ""))?;
    progress(1.0, "nodes end");
    let transformer = transformer.end()?;
    let lattices = branches.into_iter().map(Branch::end);
    Ok(RunReport {
        source: replay.bag.display().to_string(),
        clouds_in_log: replay.plan.clouds(replay.reader),
        transformer,
        lattices: lattices.collect::<Result<_, _>>()?,
        wall_s: begin.elapsed().as_secs_f64(),
    })
}

impl DdsReplay<'_> {
    fn topic(&self, wanted: impl Fn(&Role) -> bool) -> Vec<&str> {
        let roles = self.plan.roles.iter();
        let wanted = roles.filter(|(_, role)| wanted(role));
        let topics = wanted.filter_map(|(i, _)| self.reader.topics().get(*i));
        topics.map(|topic| topic.name.as_str()).collect()
    }

    fn clouds(&self) -> Vec<&str> {
        self.topic(|role| *role == Role::Cloud)
    }

    fn transformer_arguments(&self) -> Vec<String> {
        let source = self.plan.source;
        let mut arguments = vec![
            param("points_topics", &quoted(&self.clouds())),
            param("ins.source", &source.to_string()),
            param("qos./points_enu.reliability", "reliable"),
            param("qos./points_enu.depth", "512"),
        ];
        for (name, type_name) in ["ins.topic", "ins.imu_topic"]
            .iter()
            .zip(source.type_names())
        {
            for topic in self.topic(|role| *role == Role::Ins(type_name)) {
                arguments.push(param(name, topic));
            }
        }
        for topic in self.clouds() {
            arguments.push(param(&format!("qos.{topic}.reliability"), "reliable"));
            arguments.push(param(&format!("qos.{topic}.depth"), "64"));
        }
        arguments
    }

    fn player_arguments(&self) -> Vec<String> {
        let wanted = self.topic(|_| true);
        let waited = self.topic(|role| !matches!(role, Role::Transforms(_)));
        let mut arguments = vec![
            param("bag", &yaml_text(self.bag)),
            param("rate", &format!("{:?}", self.rate)),
            param("topics", &quoted(&wanted)),
            param("wait_for_subscribers", &quoted(&waited)),
        ];
        for topic in self.clouds() {
            arguments.push(param(&format!("qos.{topic}.reliability"), "reliable"));
        }
        arguments
    }
}

fn param(name: &str, value: &str) -> String {
    format!("{name}:={value}")
}

/// A path as YAML text.
fn yaml_text(path: &Path) -> String {
    format!("'{}'", path.display().to_string().replace('\'', "''"))
}

fn quoted(names: &[&str]) -> String {
    let names: Vec<String> = names.iter().map(|name| format!("'{name}'")).collect();
    format!("[{}]", names.join(", "))
}

/// One map and its markers.
struct Branch {
    namespace: String,
    mapper: NodeProcess,
    markers: NodeProcess,
}

impl Branch {
    fn start(replay: &DdsReplay, lattice: &Lattice, scratch: &Path) -> Result<Self, ProcessError> {
        let name = lattice.kind().name();
        let start = |node: &str, params: Vec<String>| {
            let report = scratch.join(format!("{name}_{node}.json"));
            NodeProcess::start_in(node, Some(name), &params, replay, &report)
        };
        let mapper = start(
            "lattice_mapper",
            vec![
                param("lattice", name),
                param("cell_volume_m3", &format!("{:?}", lattice.cell_volume_m3())),
                param("qos./points_enu.reliability", "reliable"),
                param("qos./points_enu.depth", "512"),
            ],
        )?;
        let markers = start("voxel_marker_publisher", Vec::new())?;
        Ok(Self {
            namespace: format!("/{name}"),
            mapper,
            markers,
        })
    }

    fn matched(&mut self) -> Result<(), ProcessError> {
        for topic in ["map", "map_updates"] {
            let line = format!("{}/{topic}: subscriber matched (1)", self.namespace);
            self.mapper.expect(&line)?;
            let line = format!("{}/{topic}: publisher matched (1)", self.namespace);
            self.markers.expect(&line)?;
        }
        self.mapper.expect("/points_enu: publisher matched (1)")
    }

    fn end(self) -> Result<LatticeReport, ProcessError> {
        Ok(LatticeReport {
            map: self.mapper.end()?,
            markers: self.markers.end()?,
        })
    }
}

/// A node in a process of its own, and what it logs.
struct NodeProcess {
    name: String,
    child: Child,
    lines: Receiver<String>,
    seen: Vec<String>,
    reader: Option<JoinHandle<()>>,
    report: PathBuf,
}

impl NodeProcess {
    fn start(
        node: &str,
        params: &[String],
        replay: &DdsReplay,
        report: &Path,
    ) -> Result<Self, ProcessError> {
        Self::start_in(node, None, params, replay, report)
    }

    fn start_in(
        node: &str,
        namespace: Option<&str>,
        params: &[String],
        replay: &DdsReplay,
        report: &Path,
    ) -> Result<Self, ProcessError> {
        let mut command = Command::new(std::env::current_exe()?);
        command.args(["node", node, "--ros-args", "--log-level", "info"]);
        for file in replay.params_files {
            command.arg("--params-file").arg(file);
        }
        if let Some(namespace) = namespace {
            command.args(["-r", &format!("__ns:=/{namespace}")]);
            for shared in ["points_enu", "map_origin"] {
                command.args(["-r", &format!("{shared}:=/{shared}")]);
            }
        }
        let report_file = param("report_file", &yaml_text(report));
        for param in replay.params.iter().chain(params).chain([&report_file]) {
            command.args(["-p", param]);
        }
        if let Some(domain) = &replay.domain {
            command.env("ROS_DOMAIN_ID", domain.id().to_string());
        }
        command
            .env_remove("ROS_LOCALHOST_ONLY")
            .env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        let what = match namespace {
            Some(namespace) => format!("{namespace}/{node}"),
            None => node.to_owned(),
        };
        let start = |error| ProcessError::Start {
            what: what.clone(),
            error,
        };
        let mut child = command.spawn().map_err(start)?;
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

    /// Waits until the node has logged a line with this text.
    fn expect(&mut self, text: &str) -> Result<(), ProcessError> {
        let deadline = Instant::now() + MATCH_TIME;
        while !self.seen.iter().any(|line| line.contains(text)) {
            match self.lines.recv_deadline(deadline) {
                Ok(line) => self.seen.push(line),
                Err(_) => {
                    if let Some(status) = self.child.try_wait()? {
                        return Err(self.ended(status));
                    }
                    return Err(ProcessError::NotMatched {
                        what: self.name.clone(),
                        waited: text.to_owned(),
                    });
                }
            }
        }
        Ok(())
    }

    /// Waits for the player's end and tells how far it is.
    fn played(mut self, progress: &mut dyn FnMut(f64)) -> Result<(), ProcessError> {
        while let Ok(line) = self.lines.recv() {
            let told = line.rsplit_once("played ").map(|(_, share)| share);
            let share = told.and_then(|share| share.trim_end_matches(" %").parse::<f64>().ok());
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

    /// Tells the node to end, waits until it has, and reads its report.
    fn end<T: for<'de> serde::Deserialize<'de>>(mut self) -> Result<T, ProcessError> {
        interrupt(&self.child)?;
        let deadline = Instant::now() + END_TIME;
        // The log ends when the process does.
        loop {
            match self.lines.recv_deadline(deadline) {
                Ok(line) => self.seen.push(line),
                Err(error) if error.is_timeout() => {
                    return Err(ProcessError::Stuck {
                        what: self.name.clone(),
                    });
                }
                Err(_) => break,
            }
        }
        let status = self.child.wait()?;
        if !status.success() {
            return Err(self.ended(status));
        }
        report::read(&self.report).map_err(|error| ProcessError::NoReport {
            what: self.name.clone(),
            error,
        })
    }

    fn ended(&mut self, status: ExitStatus) -> ProcessError {
        self.seen.extend(self.lines.try_iter());
        ProcessError::Ended {
            what: self.name.clone(),
            status,
            words: self.seen.last().cloned().unwrap_or_default(),
        }
    }
}

impl Drop for NodeProcess {
    /// Leaves no process behind when a replay fails half-way.
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

/// Passes the log of a node on, warnings to our own log.
fn forward(
    stderr: impl io::Read + Send + 'static,
    name: String,
    lines: Sender<String>,
) -> JoinHandle<()> {
    thread::spawn(move || {
        for line in BufReader::new(stderr).lines().map_while(Result::ok) {
            // Twelve processes say the same of one machine: it is shown once.
            let text = line.rsplit_once("]: ").map_or(&*line, |(_, text)| text);
            let warning = line.contains("[WARN]") || line.contains("[ERROR]");
            if warning && first_time(text) {
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

/// Whether no process has logged this text before.
fn first_time(text: &str) -> bool {
    static SEEN: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
    let mut seen = SEEN.lock().unwrap_or_else(PoisonError::into_inner);
    seen.len() >= MAX_TEXTS || seen.insert(text.to_owned())
}

/// The signal of Ctrl-C.
fn interrupt(child: &Child) -> io::Result<()> {
    let pid = rustix::process::Pid::from_child(child);
    Ok(rustix::process::kill_process(
        pid,
        rustix::process::Signal::INT,
    )?)
}
