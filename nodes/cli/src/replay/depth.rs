//! Processes that make clouds of the depth cameras of a replay over DDS.

use std::path::Path;

use super::dds_replay::{DdsReplay, param, quoted};
use super::node_process::NodeProcess;
use super::params::CAMERA_NODE;
use crate::CliResult;
use lattice_nodes::replay::{CameraInput, CameraReport, DepthCamera, QUEUE_SIZE};
use lattice_nodes::semantic_cloud::CloudReport;

/// Input topics of the node, by their relative names.
const INPUTS: [(CameraInput, &str); 8] = [
    (CameraInput::Depth, "depth_registered/image_rect"),
    (
        CameraInput::CompressedDepth,
        "depth_registered/image_rect/compressedDepth",
    ),
    (CameraInput::Info, "rgb/camera_info"),
    (CameraInput::Labels, LABELS),
    (CameraInput::LabelInfo, LABEL_INFO),
    (CameraInput::Confidence, "labels/confidence"),
    (CameraInput::Color, "rgb/image_rect_color"),
    (
        CameraInput::CompressedColor,
        "rgb/image_rect_color/compressed",
    ),
];
const LABELS: &str = "labels/image";
const LABEL_INFO: &str = "labels/label_info";

/// A running `semantic_cloud`.
pub struct CameraProcess {
    topic: String,
    process: NodeProcess,
}

impl CameraProcess {
    /// Ends the process and reads its report.
    pub fn end(self) -> CliResult<CameraReport> {
        let clouds: CloudReport = self.process.end()?;
        Ok(CameraReport {
            topic: self.topic,
            problem: None,
            clouds,
        })
    }
}

fn namespace(camera: usize) -> String {
    format!("depth_camera_{}", camera + 1)
}

/// Topic of the clouds of a depth camera.
pub fn points(camera: usize) -> String {
    format!("/{}/points", namespace(camera))
}

/// Starts a process for each depth camera, and waits until the transformer receives its clouds.
pub fn start(replay: &DdsReplay, scratch: &Path) -> CliResult<Vec<CameraProcess>> {
    let cameras = replay.plan.cameras.iter().enumerate();
    let start = |(i, camera): (usize, &DepthCamera)| {
        let space = namespace(i);
        let report = scratch.join(format!("{space}.json"));
        let mut process = NodeProcess::start(
            CAMERA_NODE,
            Some(&space),
            &arguments(replay, camera)?,
            &remaps(replay, camera),
            replay,
            &report,
        )?;
        process.expect(&format!("{}: subscriber matched (1)", points(i)))?;
        let topic = replay.reader.topics().get(camera.depth);
        Ok(CameraProcess {
            topic: topic.map_or(String::new(), |topic| topic.name.clone()),
            process,
        })
    };
    cameras.map(start).collect()
}

fn arguments(replay: &DdsReplay, camera: &DepthCamera) -> CliResult<Vec<String>> {
    let has = |input| (camera.topic(input).is_some()).to_string();
    let labels = match camera.is_labelled() || replay.options.has_network()? {
        true => "image",
        false => "none",
    };
    let mut arguments = vec![
        param("compressed_depth", &has(CameraInput::CompressedDepth)),
        param("compressed_color", &has(CameraInput::CompressedColor)),
        param("labels", labels),
        param("qos.points.reliability", "reliable"),
        param("qos.points.depth", "64"),
        // The reply of the lockstep.
        param("qos.labels/image.reliability", "reliable"),
    ];
    for (input, name) in INPUTS {
        if camera.topic(input).is_some() {
            arguments.push(param(&format!("qos.{name}.reliability"), "reliable"));
            arguments.push(param(&format!("qos.{name}.depth"), "64"));
        }
    }
    if camera.topic(CameraInput::LabelInfo).is_some() {
        // As it was recorded, latched or not.
        arguments.push(param(&format!("qos.{LABEL_INFO}.durability"), "volatile"));
    }
    let params = replay.options.params_of(CAMERA_NODE)?;
    if !params.is_given("queue_size") {
        arguments.push(param("queue_size", &QUEUE_SIZE.to_string()));
    }
    Ok(arguments)
}

fn remaps(replay: &DdsReplay, camera: &DepthCamera) -> Vec<String> {
    let remaps = INPUTS.into_iter().filter_map(|(input, name)| {
        let topic = replay.reader.topics().get(camera.topic(input)?)?;
        Some(format!("{name}:={}", topic.name))
    });
    remaps.collect()
}

/// Arguments of the player for networks: each image waits for the labels of the one before.
pub fn player_arguments(replay: &DdsReplay) -> CliResult<Option<String>> {
    if !replay.options.has_network()? {
        return Ok(None);
    }
    let cameras = replay.plan.cameras.iter().enumerate();
    let pairs = cameras.filter_map(|(i, camera)| {
        let color = camera.topic(CameraInput::Color);
        let color = color.or(camera.topic(CameraInput::CompressedColor))?;
        let color = replay.reader.topics().get(color)?.name.clone();
        Some([color, format!("/{}/{LABELS}", namespace(i))])
    });
    let pairs: Vec<String> = pairs.flatten().collect();
    let pairs: Vec<&str> = pairs.iter().map(String::as_str).collect();
    Ok(Some(param("lockstep", &quoted(&pairs))))
}
