//! Scans of a log with their poses.

use crate::AnyError;
use lattice_bag::{BagReader, ReadOptions};
use lattice_core::pose::{
    PoseBuffer, PoseBufferOptions, StampedPose, TransformBuffer, TransformBufferOptions,
};
use lattice_core::registration::SemanticCloud;
use lattice_msgs::cdr;
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_nodes::convert::geometry::{isometry_from_pose, isometry_from_transform};
use lattice_nodes::convert::semantic::{SemanticOptions, semantic_from_message};
use nalgebra::Isometry3;
use serde::de::DeserializeOwned;
use std::path::Path;

/// Most scans of a log; their pairs grow as the square.
const MAX_SCANS: usize = 32;

/// Topics of a log.
#[derive(Clone, PartialEq, Debug)]
pub struct KittiTopics {
    /// Clouds with labels.
    pub cloud: String,
    /// Odometry of an INS.
    pub odometry: String,
    /// Static transforms, from the odometry's child frame to that of the clouds.
    pub tf_static: String,
}

impl Default for KittiTopics {
    fn default() -> KittiTopics {
        KittiTopics {
            cloud: "/velodyne/semantic_points".to_owned(),
            odometry: "/ins/odometry".to_owned(),
            tf_static: "/tf_static".to_owned(),
        }
    }
}

/// A scan and its true pose.
#[derive(Clone, PartialEq, Debug)]
pub struct Scan {
    /// Seconds after the first one, as a name.
    pub name: String,
    /// Labelled points, metres, sensor frame.
    pub cloud: SemanticCloud,
    /// `map_from_sensor` at its stamp: odometry, linear and slerp between messages, times the static transform.
    pub map_from_sensor: Isometry3<f64>,
}

/// All scans of a log, in order of time; every one must have a label on some point, and a pose.
pub fn read_scans(bag: &Path, topics: &KittiTopics) -> Result<Vec<Scan>, AnyError> {
    let reader = BagReader::open(bag)?;
    let names = [&topics.cloud, &topics.odometry, &topics.tf_static].map(String::clone);
    let options = ReadOptions {
        topics: Some(names.to_vec()),
        ..ReadOptions::default()
    };
    let mut poses = PoseBuffer::new(PoseBufferOptions {
        span_s: 1e6,
        max_poses: 1_000_000,
        ..PoseBufferOptions::default()
    });
    let mut frames = TransformBuffer::new(TransformBufferOptions::default());
    let mut clouds: Vec<PointCloud2> = Vec::new();
    let mut machine = String::new();
    for message in reader.messages(&options)? {
        let message = message?;
        let topic = reader.topics().get(message.topic);
        let topic = topic.map_or("", |topic| topic.name.as_str());
        if topic == topics.cloud {
            clouds.push(decode(topic, &message.data)?);
        } else if topic == topics.odometry {
            let odometry: Odometry = decode(topic, &message.data)?;
            if let Some(map_from_base) = isometry_from_pose(&odometry.pose.pose) {
                let stamp_ns = odometry.header.stamp.to_ns();
                poses.push(StampedPose {
                    stamp_ns,
                    map_from_base,
                });
            }
            machine = odometry.child_frame_id;
        } else {
            insert(&mut frames, &decode(topic, &message.data)?)?;
        }
        if clouds.len() > MAX_SCANS {
            break;
        }
    }
    if !(2..=MAX_SCANS).contains(&clouds.len()) {
        let (topic, scans) = (&topics.cloud, clouds.len());
        return Err(format!("{topic} has {scans} scans, not 2 to {MAX_SCANS}").into());
    }
    let first_ns = clouds.first().map_or(0, |c| c.header.stamp.to_ns());
    let scan = |(number, message): (usize, &PointCloud2)| {
        let stamp_ns = message.header.stamp.to_ns();
        let pose = poses.at(stamp_ns);
        let map_from_base = pose.map_err(|error| format!("scan {number}: {error}"))?;
        let base_from_sensor = frames.lookup(&machine, &message.header.frame_id, stamp_ns)?;
        let options = SemanticOptions {
            require_labels: true,
            ..SemanticOptions::default()
        };
        let (cloud, _) = semantic_from_message(message, &options)
            .map_err(|error| format!("{}: {error}", topics.cloud))?;
        Ok(Scan {
            name: format!("{:.2} s", stamp_ns.saturating_sub(first_ns) as f64 * 1e-9),
            cloud,
            map_from_sensor: map_from_base * base_from_sensor,
        })
    };
    clouds.iter().enumerate().map(scan).collect()
}

fn insert(frames: &mut TransformBuffer, message: &TFMessage) -> Result<(), AnyError> {
    for t in &message.transforms {
        if let Some(parent_from_child) = isometry_from_transform(&t.transform) {
            let (parent, child) = (&t.header.frame_id, &t.child_frame_id);
            frames.insert(parent, child, 0, parent_from_child, true)?;
        }
    }
    Ok(())
}

fn decode<M: DeserializeOwned>(topic: &str, data: &[u8]) -> Result<M, AnyError> {
    cdr::from_slice(data).map_err(|error| format!("{topic}: {error}").into())
}
