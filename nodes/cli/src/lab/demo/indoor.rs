//! `lattice demo --indoor`: a robot surveys a house with a depth camera, and a headset joins it.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::time::Instant;

use lattice_lab::datasets::{Indoor, IndoorOptions, label_accuracy, write_indoor};
use lattice_msgs::lattice::CalibrationResult;
use lattice_nodes::convert::calibration::verdict_name;
use lattice_nodes::convert::geometry::isometry_from_transform;
use lattice_nodes::files::atomic_write::write_text;
use lattice_nodes::headset_cloud::HeadsetReport;
use lattice_nodes::lattice_mapper::MapperReport;
use lattice_nodes::report;
use lattice_nodes::semantic_cloud::CloudReport;
use lattice_runtime::LoopbackDomain;

use super::indoor_report::IndoorReport;
use super::indoor_results::Results;
use crate::CliResult;
use crate::progress::Progress;
use crate::replay::node_process::{NodeProcess, warn_of_short_buffer};
use crate::replay::{param, quoted, yaml_text};

/// Parameters of the nodes, for users to copy.
const PARAMS: [(&str, &str); 4] = [
    ("rgbd.yaml", include_str!("../../../../../params/rgbd.yaml")),
    (
        "headset.yaml",
        include_str!("../../../../../params/headset.yaml"),
    ),
    (
        "segmenter.yaml",
        include_str!("../../../../../params/segmenter.yaml"),
    ),
    (
        "viewer.yaml",
        include_str!("../../../../../params/viewer.yaml"),
    ),
];
/// Volume of a cell of these parameters, m^3.
const CELL_VOLUME_M3: f64 = 0.000125;
/// Time between two images of the robot, s.
const PERIOD_S: f64 = 0.125;
/// Looks of the headset.
const LOOKS: usize = 12;
/// Pixels in a row of the images.
const WIDTH: usize = 256;
/// Topics of the log that must reach their nodes whole.
const INPUTS: [(&str, &str); 4] = [
    ("semantic_cloud", "/depth_registered/image_rect"),
    ("semantic_cloud", "/rgb/camera_info"),
    ("headset_cloud", "/headset/camera_info"),
    ("headset_cloud", "/headset/pose"),
];
/// The same of images of true labels, and of colours.
const LABELS: [(&str, &str); 2] = [
    ("semantic_cloud", "/labels/image"),
    ("headset_cloud", "/headset/labels/image"),
];
const COLORS: [(&str, &str); 2] = [
    ("segmenter", "/rgb/image_rect_color"),
    ("segmenter", "/headset/image"),
];
/// Images that a network labels, each with the topic of its labels: the log waits for them.
const LOCKSTEP: [(&str, &str); 2] = [
    ("/rgb/image_rect_color", "/labels/image"),
    ("/headset/image", "/headset/labels/image"),
];
/// Names of the segmenter's topics where it labels the headset's images.
const OF_HEADSET: [&str; 4] = [
    "rgb/image_rect_color:=headset/image",
    "labels/image:=headset/labels/image",
    "labels/confidence:=headset/labels/confidence",
    "labels/label_info:=headset/labels/label_info",
];

/// An indoor demo.
pub struct IndoorDemo {
    /// Directory for the log and the map.
    pub out: PathBuf,
    /// Seed of the simulation.
    pub seed: u64,
    /// Speed of the log, 1 is real time.
    pub rate: f64,
    /// Views of the robot.
    pub views: usize,
    /// File of the network; without one images are true labels.
    pub model: Option<PathBuf>,
    /// Port of the page, if there is to be one.
    pub viewer: Option<u16>,
    /// True if the page stays after the report, until Ctrl-C.
    pub page_stays: bool,
    /// True for a report in JSON.
    pub json: bool,
}

/// The processes of the nodes.
struct Nodes {
    robot: NodeProcess,
    headset: NodeProcess,
    /// Serves the page while it lives.
    _viewer: Option<NodeProcess>,
    /// Address of the page.
    url: Option<String>,
    results: Results,
}

impl IndoorDemo {
    /// Runs the command.
    pub fn run(&self) -> CliResult {
        let begin = Instant::now();
        let indoor = self.simulate()?;
        eprintln!("{}", indoor.summary);
        let scratch = tempfile::tempdir()?;
        for (name, text) in PARAMS {
            write_text(&self.out.join(name), text)?;
        }
        let domain = LoopbackDomain::take()?;
        let mut nodes = self.start(&domain, scratch.path())?;
        self.play(&domain, scratch.path(), nodes.url.as_deref())?;
        let last = nodes.results.last();
        if nodes.results.is_interrupted() {
            return Err("ended by a signal".into());
        }
        let report = self.report(
            nodes.robot,
            nodes.headset,
            scratch.path(),
            &indoor,
            last,
            begin,
        )?;
        if !report.dropped.is_empty() {
            warn_of_short_buffer();
        }
        match self.json {
            true => println!("{}", serde_json::to_string_pretty(&report)?),
            false => println!(
                "{report}log, parameters and map are in {}",
                self.out.display()
            ),
        }
        if let (true, Some(url)) = (self.page_stays, nodes.url.take()) {
            println!("the page stays at {url} with this map; Ctrl-C ends it");
            nodes.results.until_interrupted();
        }
        Ok(())
    }

    fn simulate(&self) -> CliResult<Indoor> {
        let progress = Progress::new("simulate");
        let options = IndoorOptions {
            out: self.out.join("log"),
            overwrite: true,
            seed: self.seed,
            views: self.views,
            period_s: PERIOD_S,
            width: WIDTH,
            looks: LOOKS,
            colors: self.model.is_some(),
            cell_volume_m3: CELL_VOLUME_M3,
        };
        let indoor = write_indoor(&options, &mut |done| progress.set(done))?;
        progress.done();
        Ok(indoor)
    }

    fn start(&self, domain: &LoopbackDomain, scratch: &Path) -> CliResult<Nodes> {
        let results = Results::listen(domain)?;
        let map = |name: &str, value: &str| param(&format!("lattice_mapper:{name}"), value);
        let robot = [
            map("lattice", "cubic"),
            map("map_dir", &yaml_text(&self.out)),
            map("autosave_file", "map.lattice"),
            map("autosave_period_s", "3600.0"),
        ];
        let (viewer, url) = match self.viewer {
            Some(port) => {
                let port = param("viewer_server:port", &port.to_string());
                let mut viewer = self.nodes(domain, scratch, &["viewer_server"], &[port])?;
                let line = viewer.expect("the map is at ")?;
                let url = line.rsplit(' ').next().unwrap_or_default();
                (Some(viewer), Some(url.to_owned()))
            }
            None => (None, None),
        };
        let mut of_robot = vec!["semantic_cloud", "lattice_mapper", "enu_transformer"];
        let mut of_headset = vec!["headset_cloud", "semantic_icp_server"];
        // All that the headset looks at, at half the columns and rows of its small images.
        let of_looks = [
            param("semantic_icp_server:max_headset_scans", "6"),
            param("headset_cloud:stride", "2"),
        ];
        let (mut robot, mut headset) = (robot.to_vec(), of_looks.to_vec());
        if let Some(model) = &self.model {
            let model = param("segmenter:model", &yaml_text(model));
            for (nodes, params) in [(&mut of_robot, &mut robot), (&mut of_headset, &mut headset)] {
                nodes.push("segmenter");
                params.push(model.clone());
            }
            robot.push(param("semantic_cloud:use_confidence", "true"));
            headset.push(param("headset_cloud:use_confidence", "true"));
            // The player waits for each, and may know of the topic later than the first comes.
            for ((_, labels), params) in LOCKSTEP.iter().zip([&mut robot, &mut headset]) {
                for (key, value) in [
                    ("reliability", "reliable"),
                    ("durability", "transient_local"),
                ] {
                    params.push(param(&format!("segmenter:qos.{labels}.{key}"), value));
                }
            }
        }
        Ok(Nodes {
            robot: self.nodes(domain, scratch, &of_robot, &robot)?,
            headset: self.nodes(domain, scratch, &of_headset, &headset)?,
            _viewer: viewer,
            url,
            results,
        })
    }

    /// Starts nodes in one process, each with a report.
    fn nodes(
        &self,
        domain: &LoopbackDomain,
        scratch: &Path,
        nodes: &[&str],
        params: &[String],
    ) -> CliResult<NodeProcess> {
        let mut command = Command::new(std::env::current_exe()?);
        command.arg("run");
        for (name, _) in PARAMS {
            command.arg(self.out.join(name));
        }
        for node in nodes {
            command.args(["--only", node]);
        }
        command.args(["--", "--ros-args", "--log-level", "info"]);
        let mut all = params.to_vec();
        // A segmenter is in either process.
        let has_headset = nodes.contains(&"headset_cloud");
        if has_headset {
            for names in OF_HEADSET {
                command.args(["-r", &format!("segmenter:{names}")]);
            }
        }
        let reports = |node: &&&str| !["semantic_icp_server", "segmenter"].contains(node);
        for node in nodes.iter().filter(reports) {
            let file = yaml_text(&report_file(scratch, node));
            all.push(param(&format!("{node}:report_file"), &file));
        }
        let is_taken = |(node, topic): &(&str, &str)| {
            nodes.contains(node) && topic.starts_with("/headset/") == has_headset
        };
        for (node, topic) in self.inputs().filter(is_taken) {
            all.push(param(
                &format!("{node}:qos.{topic}.reliability"),
                "reliable",
            ));
            all.push(param(&format!("{node}:qos.{topic}.depth"), "100"));
        }
        all.iter().for_each(|param| _ = command.args(["-p", param]));
        let first = nodes.first().copied().unwrap_or_default();
        let file = report_file(scratch, first);
        NodeProcess::spawn(command, nodes.join(","), domain, &file)
    }

    /// Topics of the log with the nodes that take them.
    fn inputs(&self) -> impl Iterator<Item = (&'static str, &'static str)> {
        let images = match self.model {
            Some(_) => COLORS,
            None => LABELS,
        };
        INPUTS.into_iter().chain(images)
    }

    /// Topics of the log by their use.
    fn topics(&self) -> String {
        let images = match self.model {
            Some(_) => "colours /rgb/image_rect_color, which a network labels",
            None => "true labels /labels/image",
        };
        format!(
            "clouds: of depth /depth_registered/image_rect and {images}; poses and mounts: /tf; \
             headset: /headset/mesh, its images and /headset/pose"
        )
    }

    /// Plays the log to its end.
    fn play(&self, domain: &LoopbackDomain, scratch: &Path, url: Option<&str>) -> CliResult {
        let progress = Progress::new("play");
        progress.print(&self.topics());
        progress.say("the robot surveys the house, then the headset joins");
        let waited: Vec<&str> = self.inputs().map(|(_, topic)| topic).collect();
        let lockstep: Vec<&str> = match self.model {
            Some(_) => LOCKSTEP
                .iter()
                .flat_map(|(images, labels)| [*images, *labels])
                .collect(),
            None => Vec::new(),
        };
        let mut command = Command::new(std::env::current_exe()?);
        command.args(["node", "bag_player", "--ros-args", "--log-level", "info"]);
        for param in [
            param("bag", &yaml_text(&self.out.join("log"))),
            param("rate", &format!("{:?}", self.rate)),
            param("max_wait_s", "600.0"),
            param("keyboard", "false"),
            param("wait_for_subscribers", &quoted(&waited)),
            param("lockstep", &quoted(&lockstep)),
        ] {
            command.args(["-p", &param]);
        }
        let file = report_file(scratch, "bag_player");
        let player = NodeProcess::spawn(command, "bag_player".to_owned(), domain, &file)?;
        let mut url = url;
        player.played(&mut |done| {
            progress.set(done);
            // A page that is opened now has a map to show.
            if let Some(url) = url.take() {
                progress.print(&format!(
                    "watch the robot, its map and the headset at {url}"
                ));
            }
        })?;
        progress.done();
        Ok(())
    }

    fn report(
        &self,
        robot: NodeProcess,
        headset: NodeProcess,
        scratch: &Path,
        indoor: &Indoor,
        (last, search_s): (Option<Arc<CalibrationResult>>, f64),
        begin: Instant,
    ) -> CliResult<IndoorReport> {
        let headset: HeadsetReport = headset.end()?;
        let clouds: CloudReport = robot.end()?;
        let mapper: MapperReport = report::read(&report_file(scratch, "lattice_mapper"))?;
        let (map, _) = crate::map::read(&self.out.join("map.lattice"))?;
        let map_labels = label_accuracy(&map.into_list(usize::MAX), &indoor.truth);
        let found = last.as_ref().filter(|last| last.points > 0);
        let found = found.and_then(|last| isometry_from_transform(&last.transform));
        let error = found.map(|found| indoor.map_from_headset.inverse() * found);
        let mut dropped = clouds.counts.dropped.clone();
        // Both nodes have reasons of the same names.
        for (reason, count) in &headset.counts.dropped {
            *dropped.entry(format!("headset_{reason}")).or_default() += count;
        }
        Ok(IndoorReport {
            labels: match self.model {
                Some(_) => "of a network",
                None => "true ones, no network",
            },
            images: indoor.summary.images,
            clouds: clouds.counts.clouds_out,
            points: clouds.counts.points.points,
            dropped,
            voxels: mapper.voxels,
            map_labels,
            label_share: map_labels.share(),
            triangles: indoor.summary.triangles,
            headset_clouds: headset.counts.clouds_out,
            headset_points: headset.counts.look.points,
            verdict: last
                .as_ref()
                .map_or("none", |last| verdict_name(last.verdict))
                .to_owned(),
            reason: last
                .as_ref()
                .map_or_else(String::new, |last| last.reason.clone()),
            off_m: error.map(|error| error.translation.vector.norm()),
            off_deg: error.map(|error| error.rotation.angle().to_degrees()),
            search_s,
            wall_s: begin.elapsed().as_secs_f64(),
        })
    }
}

fn report_file(scratch: &Path, node: &str) -> PathBuf {
    scratch.join(format!("{node}.json"))
}
