//! Replay over DDS: the player and one process per node, on a separate loopback domain.

use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Instant;

use lattice_core::lattice::{Lattice, LatticeKind};

pub use super::dds_replay::{DdsReplay, param, quoted, yaml_text};
use super::depth;
use super::map_file;
use super::node_process::{NodeProcess, warn_of_short_buffer};
use crate::CliResult;
use crate::progress::Progress;
use lattice_nodes::files::atomic_write;
use lattice_nodes::replay::{LatticeReport, Role, RunReport};

/// Plays the log through separate processes and collects their reports.
pub fn run(replay: &DdsReplay) -> CliResult<RunReport> {
    let progress = Progress::new("play");
    let scratch = tempfile::tempdir()?;
    let begin = Instant::now();
    progress.say("waiting for discovery");
    let mut branches = Vec::new();
    for lattice in &replay.lattices {
        let port = replay.viewer_port(lattice);
        branches.push(Branch::start(replay, lattice, port, scratch.path())?);
    }
    let mut transformer = NodeProcess::start(
        "enu_transformer",
        None,
        &replay.transformer_arguments(),
        &[],
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
    let cameras = depth::start(replay, scratch.path())?;
    let player = NodeProcess::start(
        "bag_player",
        None,
        &replay.player_arguments()?,
        &[],
        replay,
        &scratch.path().join("bag_player.json"),
    )?;
    progress.say("");
    let mut pages: Vec<String> = branches.iter_mut().filter_map(|b| b.page.take()).collect();
    player.played(&mut |done| {
        progress.set(done);
        // A page opened now has a map to show.
        for page in pages.drain(..) {
            progress.print(&page);
        }
    })?;
    progress.set(1.0);
    progress.say("nodes end");
    let cameras = cameras.into_iter().map(depth::CameraProcess::end);
    let cameras = cameras.collect::<CliResult<_>>()?;
    let transformer = transformer.end()?;
    // The branch with the page ends last, so that the page stays available.
    let (last, first): (Vec<_>, Vec<_>) =
        { branches.into_iter().enumerate() }.partition(|(_, branch)| branch.has_page);
    let ends = first.into_iter().chain(last);
    let ends = ends.map(|(i, branch)| Ok((i, branch.end()?)));
    let lattices: BTreeMap<usize, LatticeReport> = ends.collect::<CliResult<_>>()?;
    let report = RunReport {
        source: replay.options.bag.display().to_string(),
        clouds_in_log: replay.plan.clouds(replay.reader),
        transformer,
        cameras,
        lattices: lattices.into_values().collect(),
        origin: None,
        odometry: None,
        implausible_rows: replay.reader.implausible_rows(),
        cuts: replay.reader.cuts(),
        fit: Vec::new(),
        choices: replay.plan.choices.clone(),
        wall_s: begin.elapsed().as_secs_f64(),
    };
    progress.done();
    if !report.losses().is_empty() {
        warn_of_short_buffer();
    }
    replay.keep_maps(scratch.path(), &report)?;
    Ok(report)
}

impl DdsReplay<'_> {
    /// Port of the viewer for this lattice: FCC, or else the first.
    fn viewer_port(&self, lattice: &Lattice) -> Option<u16> {
        let mut all = self.lattices.iter().map(Lattice::kind);
        let first = all.clone().next();
        let shown = all.find(|kind| *kind == LatticeKind::Fcc).or(first);
        self.options
            .viewer
            .filter(|_| shown == Some(lattice.kind()))
    }

    /// Moves the maps saved by the mappers to the user's paths.
    fn keep_maps(&self, scratch: &Path, report: &RunReport) -> CliResult {
        let path = self.options.map_out.as_ref();
        let Some(path) = path.filter(|_| self.options.refused(report).is_none()) else {
            return Ok(());
        };
        let several = self.lattices.len() > 1;
        for (lattice, report) in self.lattices.iter().zip(&report.lattices) {
            if report.map.voxels == 0 {
                // A mapper does not save an empty map.
                continue;
            }
            let saved: PathBuf = scratch.join(saved_map(lattice.kind().name()));
            let mut saved = File::open(&saved).map_err(|e| format!("{}: {e}", saved.display()))?;
            let to = map_file(path, lattice.kind(), several);
            atomic_write::write(&to, |file| io::copy(&mut saved, file))?;
        }
        Ok(())
    }

    /// Topics of the log with a role.
    pub fn topic<'a>(&'a self, wanted: impl Fn(Role) -> bool + 'a) -> Vec<&'a str> {
        let topics = self.plan.topics(self.reader, wanted);
        topics.map(|topic| topic.name.as_str()).collect()
    }

    /// Topics of clouds, those of depth cameras included.
    fn clouds(&self) -> Vec<String> {
        let of_log = self
            .topic(|role| matches!(role, Role::Cloud(_)))
            .into_iter();
        let of_cameras = (0..self.plan.cameras.len()).map(depth::points);
        of_log.map(str::to_owned).chain(of_cameras).collect()
    }

    /// Remap rules for transform topics with other names than the nodes use.
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
        let clouds = self.clouds();
        let clouds: Vec<&str> = clouds.iter().map(String::as_str).collect();
        let mut arguments = vec![
            param("points_topics", &quoted(&clouds)),
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
        for topic in clouds {
            arguments.push(param(&format!("qos.{topic}.reliability"), "reliable"));
            arguments.push(param(&format!("qos.{topic}.depth"), "64"));
        }
        arguments
    }

    fn player_arguments(&self) -> CliResult<Vec<String>> {
        // The node compares attitudes with no Imu but that of its poses.
        let wanted = self.topic(|role| role != Role::Imu);
        let waited = self.topic(|role| !matches!(role, Role::Transforms(_) | Role::Imu));
        let mut arguments = vec![
            param("bag", &yaml_text(&self.options.bag)),
            param("rate", &format!("{:?}", self.options.rate)),
            // No message may be skipped.
            param("max_wait_s", "600.0"),
            param("keyboard", "false"),
            param("topics", &quoted(&wanted)),
            param("wait_for_subscribers", &quoted(&waited)),
        ];
        let images = |role| matches!(role, Role::Cloud(_) | Role::Camera(_));
        for topic in self.topic(images) {
            arguments.push(param(&format!("qos.{topic}.reliability"), "reliable"));
        }
        arguments.extend(depth::player_arguments(self)?);
        Ok(arguments)
    }
}

/// File name of the saved map of a lattice.
fn saved_map(name: &str) -> String {
    format!("{name}.lattice")
}

/// One map with its markers.
struct Branch {
    namespace: String,
    mapper: NodeProcess,
    markers: NodeProcess,
    has_page: bool,
    /// Line with the URL of the page.
    page: Option<String>,
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
            NodeProcess::start(node, Some(name), &params, &[], replay, &report)
        };
        let orientation = replay.options.orientation;
        let orientation = orientation.map(|o| param("lattice_orientation", &o.to_string()));
        let mut params = vec![
            param("lattice", name),
            param("cell_volume_m3", &format!("{:?}", lattice.cell_volume_m3())),
            param("map_frame", &replay.plan.map_frame),
            // Overrides one from a file.
            param("cell_size_m", "0.0"),
            param("qos./points_enu.reliability", "reliable"),
            param("qos./points_enu.depth", "512"),
        ];
        params.extend(orientation);
        if replay.options.map_out.is_some() {
            params.extend([
                param("map_dir", &yaml_text(scratch)),
                param("autosave_file", &saved_map(name)),
                // Saved at the end only.
                param("autosave_period_s", "86400.0"),
            ]);
        }
        let mapper = start("lattice_mapper", params)?;
        let mut markers = match viewer_port {
            // In one process: loopback discovery is limited to twelve participants, which five lattices need.
            Some(port) => {
                let port = param("viewer_server:port", &port.to_string());
                start("voxel_marker_publisher,viewer_server", vec![port])?
            }
            None => start("voxel_marker_publisher", Vec::new())?,
        };
        let has_page = viewer_port.is_some();
        let page = match has_page {
            true => {
                let line = markers.expect("the map is at ")?;
                let url = line.rsplit(' ').next().unwrap_or_default();
                Some(format!("watch the {name} map grow at {url}"))
            }
            false => None,
        };
        Ok(Self {
            namespace: format!("/{name}"),
            mapper,
            markers,
            has_page,
            page,
        })
    }

    fn matched(&mut self) -> CliResult {
        for topic in ["voxel_map", "voxel_map_updates"] {
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
            markers: Some(self.markers.end()?),
        })
    }
}
