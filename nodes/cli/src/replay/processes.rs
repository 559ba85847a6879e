//! Replay over DDS: the player and one process for each node, on a loopback domain of their own.

use std::path::Path;
use std::time::Instant;

use lattice_core::lattice::{Lattice, LatticeKind};

use super::Replay;
use super::node_process::NodeProcess;
use crate::CliResult;
use crate::progress::Progress;
use lattice_bag::BagReader;
use lattice_nodes::replay::{LatticeReport, Role, RunReport, TopicPlan};
use lattice_runtime::LoopbackDomain;

/// A replay over DDS.
pub struct DdsReplay<'a> {
    /// Options of the command.
    pub options: &'a Replay,
    /// The log.
    pub reader: &'a BagReader,
    /// Roles of its topics.
    pub plan: &'a TopicPlan,
    /// One map for each.
    pub lattices: Vec<Lattice>,
    /// Domain of the processes; `None`: that of `ROS_DOMAIN_ID`.
    pub domain: Option<LoopbackDomain>,
}

/// Plays the log through separate processes and collects their reports.
pub fn run(replay: &DdsReplay) -> CliResult<RunReport> {
    let progress = Progress::new("play");
    let scratch = tempfile::tempdir()?;
    let begin = Instant::now();
    progress.say("nodes find each other");
    let mut branches = Vec::new();
    for lattice in &replay.lattices {
        let port = replay.viewer_port(lattice);
        branches.push(Branch::start(replay, lattice, port, scratch.path())?);
    }
    let mut transformer = NodeProcess::start(
        "enu_transformer",
        None,
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
        None,
        &replay.player_arguments(),
        replay,
        &scratch.path().join("bag_player.json"),
    )?;
    progress.say("");
    player.played(&mut |done| progress.set(done))?;
    progress.set(1.0);
    progress.say("nodes end");
    let transformer = transformer.end()?;
    let lattices = branches.into_iter().map(Branch::end);
    let report = RunReport {
        source: replay.options.bag.display().to_string(),
        clouds_in_log: replay.plan.clouds(replay.reader),
        transformer,
        lattices: lattices.collect::<Result<_, _>>()?,
        origin: None,
        implausible_rows: replay.reader.implausible_rows(),
        choices: replay.plan.choices.clone(),
        wall_s: begin.elapsed().as_secs_f64(),
    };
    progress.done();
    Ok(report)
}

impl DdsReplay<'_> {
    /// Port of the viewer if it shows this lattice: FCC, or else the first.
    fn viewer_port(&self, lattice: &Lattice) -> Option<u16> {
        let mut all = self.lattices.iter().map(Lattice::kind);
        let first = all.clone().next();
        let shown = all.find(|kind| *kind == LatticeKind::Fcc).or(first);
        self.options
            .viewer
            .filter(|_| shown == Some(lattice.kind()))
    }

    fn topic<'a>(&'a self, wanted: impl Fn(Role) -> bool + 'a) -> Vec<&'a str> {
        let topics = self.plan.topics(self.reader, wanted);
        topics.map(|topic| topic.name.as_str()).collect()
    }

    fn clouds(&self) -> Vec<&str> {
        self.topic(|role| role == Role::Cloud)
    }

    /// Topics of transforms that are not named as the nodes name them, with the names that they get.
    pub fn remaps(&self) -> Vec<String> {
        let named = [("/tf", false), ("/tf_static", true)];
        let remaps = named.into_iter().flat_map(|(name, is_static)| {
            let topics = self.topic(move |role| role == Role::Transforms(is_static));
            let others = topics.into_iter().filter(move |topic| *topic != name);
            others.map(move |topic| format!("{name}:={topic}"))
        });
        remaps.collect()
    }

    fn transformer_arguments(&self) -> Vec<String> {
        let source = self.plan.source;
        let mut arguments = vec![
            param("points_topics", &quoted(&self.clouds())),
            param("ins.source", &source.to_string()),
            param("map_frame", &self.plan.map_frame),
            param("base_frame", &self.plan.base_frame),
            param("qos./points_enu.reliability", "reliable"),
            param("qos./points_enu.depth", "512"),
        ];
        for (name, type_name) in ["ins.topic", "ins.imu_topic"]
            .iter()
            .zip(source.type_names())
        {
            for topic in self.topic(move |role| role == Role::Ins(type_name)) {
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
            param("bag", &yaml_text(&self.options.bag)),
            param("rate", &format!("{:?}", self.options.rate)),
            // Nothing may be lost.
            param("max_wait_s", "600.0"),
            param("keyboard", "false"),
            param("topics", &quoted(&wanted)),
            param("wait_for_subscribers", &quoted(&waited)),
        ];
        for topic in self.clouds() {
            arguments.push(param(&format!("qos.{topic}.reliability"), "reliable"));
        }
        arguments
    }
}

/// A parameter as `-p` takes it.
pub fn param(name: &str, value: &str) -> String {
    format!("{name}:={value}")
}

/// A path as YAML text.
pub fn yaml_text(path: &Path) -> String {
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
    fn start(
        replay: &DdsReplay,
        lattice: &Lattice,
        viewer_port: Option<u16>,
        scratch: &Path,
    ) -> CliResult<Self> {
        let name = lattice.kind().name();
        let start = |node: &str, params: Vec<String>| {
            let report = scratch.join(format!("{name}_{node}.json"));
            NodeProcess::start(node, Some(name), &params, replay, &report)
        };
        let orientation = replay.options.orientation;
        let orientation = orientation.map(|o| param("lattice_orientation", &o.to_string()));
        let mut params = vec![
            param("lattice", name),
            param("cell_volume_m3", &format!("{:?}", lattice.cell_volume_m3())),
            param("map_frame", &replay.plan.map_frame),
            // In place of one in a file.
            param("cell_size_m", "0.0"),
            param("qos./points_enu.reliability", "reliable"),
            param("qos./points_enu.depth", "512"),
        ];
        params.extend(orientation);
        let mapper = start("lattice_mapper", params)?;
        let mut markers = match viewer_port {
            // In one process: twelve find each other, and five lattices need them all.
            Some(port) => {
                let port = param("viewer_server:port", &port.to_string());
                start("voxel_marker_publisher,viewer_server", vec![port])?
            }
            None => start("voxel_marker_publisher", Vec::new())?,
        };
        if viewer_port.is_some() {
            let line = markers.expect("the map is at ")?;
            let url = line.rsplit(' ').next().unwrap_or_default();
            eprintln!("watch the {name} map grow at {url}");
        }
        Ok(Self {
            namespace: format!("/{name}"),
            mapper,
            markers,
        })
    }

    fn matched(&mut self) -> CliResult {
        for topic in ["map", "map_updates"] {
            let line = format!("{}/{topic}: subscriber matched (1)", self.namespace);
            self.mapper.expect(&line)?;
            let line = format!("{}/{topic}: publisher matched (1)", self.namespace);
            self.markers.expect(&line)?;
        }
        self.mapper
            .expect("/points_enu: publisher matched (1)")
            .map(drop)
    }

    fn end(self) -> CliResult<LatticeReport> {
        Ok(LatticeReport {
            map: self.mapper.end()?,
            markers: self.markers.end()?,
        })
    }
}
