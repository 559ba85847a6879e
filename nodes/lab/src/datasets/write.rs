//! The simulated log as a rosbag2 directory.

use super::bobcat_options::BobcatOptions;
use super::facts::{
    INSPVAX_TOPIC, ODOMETRY_TOPIC, TF_STATIC_TOPIC, TF_TOPIC, points_topic, scan_topic,
};
use super::log::{Block, Log};
use super::truth::{self, Truth};
use crate::simulate::{Bobcat, Laser};
use crate::{AnyError, at};
use lattice_bag::{BagQos, BagWriter, TopicSpec, WriterOptions, replaceable};
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::novatel_oem7_msgs::INSPVAX;
use lattice_msgs::sensor_msgs::{LaserScan, PointCloud2};
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_msgs::{RosMessage, hash_of};
use nalgebra::{Isometry3, Vector3};
use serde::Serialize;
use std::collections::HashMap;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::Builder;

/// Summary of a written log.
#[derive(Clone, Debug, PartialEq, Default, Serialize)]
pub struct BobcatSummary {
    /// Directory of the bag.
    pub out: PathBuf,
    /// Length of the log, s.
    pub duration_s: f64,
    /// Messages on all topics.
    pub messages: u64,
    /// Clouds or scans among them.
    pub clouds: u64,
    /// Points in them.
    pub points: u64,
    /// INS epochs, each of which is an INSPVAX and an Odometry.
    pub ins_epochs: u64,
}

impl fmt::Display for BobcatSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}: {:.1} s, {} messages, {} clouds with {} points, {} poses",
            self.out.display(),
            self.duration_s,
            self.messages,
            self.clouds,
            self.points,
            self.ins_epochs
        )
    }
}

/// Simulates the skid-steer loader and writes its log as a rosbag2 directory, the truth beside it. `progress` gets
/// the share done.
pub fn write_bobcat(
    options: &BobcatOptions,
    progress: &mut dyn FnMut(f64),
) -> Result<BobcatSummary, AnyError> {
    let earlier = earlier(&options.out, options.overwrite)?;
    let (Some(name), false) = (options.out.file_name(), earlier.is_empty()) else {
        return write_log(options, progress);
    };
    // The earlier log goes when the new one is whole.
    let parent = options.out.parent().filter(|p| *p != Path::new(""));
    let parent = parent.unwrap_or(Path::new("."));
    let beside = Builder::new().prefix(".lattice_").tempdir_in(parent);
    let beside = beside.map_err(at(parent))?;
    let mut there = options.clone();
    there.out = beside.path().join(name);
    let mut summary = write_log(&there, progress)?;
    replace(&options.out, &earlier, &there.out)?;
    summary.out.clone_from(&options.out);
    Ok(summary)
}

fn write_log(
    options: &BobcatOptions,
    progress: &mut dyn FnMut(f64),
) -> Result<BobcatSummary, AnyError> {
    let [east_m, north_m, up_m, turn_deg] = options.ins_offset;
    if options.ins_offset.iter().any(|offset| !offset.is_finite()) {
        return Err(format!("an INS cannot be off by {:?}", options.ins_offset).into());
    }
    let ins_offset = Isometry3::new(
        Vector3::new(east_m, north_m, up_m),
        Vector3::z() * turn_deg.to_radians(),
    );
    let bobcat = Bobcat::new(options.seed, options.duration_s)?
        .starting_at(options.begin_s)?
        .with_person(options.person)
        .with_ins_offset(ins_offset);
    let writer = WriterOptions::default();
    let mut bag = BagWriter::create(&options.out, options.storage, writer)?;
    let mut topics = HashMap::new();
    for topic in topic_specs(options.scans) {
        let name = topic.name.clone();
        topics.insert(name, bag.add_topic(topic)?);
    }
    let mut truth = Truth::create(options)?;
    let mut summary = BobcatSummary {
        out: options.out.clone(),
        duration_s: options.duration_s,
        ..BobcatSummary::default()
    };
    let mut log = Log::new(&bobcat, options.scans)?;
    while let Some(block) = log.next_block()? {
        write_block(&block, &mut bag, &topics, &mut truth, &mut summary)?;
        let done_ns = block.end_ns.saturating_sub(bobcat.begin_ns());
        progress((done_ns as f64 * 1e-9 / options.duration_s).min(1.0));
    }
    truth.finish()?;
    bag.finish()?;
    Ok(summary)
}

fn write_block(
    block: &Block<'_>,
    bag: &mut BagWriter,
    topics: &HashMap<String, usize>,
    truth: &mut Truth,
    summary: &mut BobcatSummary,
) -> Result<(), AnyError> {
    for entry in &block.entries {
        let topic = topics.get(entry.topic).copied().unwrap_or(usize::MAX);
        bag.write(topic, entry.log_time_ns, &entry.cdr)?;
        truth.points(&entry.true_points_m)?;
        summary.messages += 1;
        summary.points += entry.true_points_m.len() as u64;
        let of_lasers = [points_topic, scan_topic].map(|name| Laser::ALL.map(name));
        let is_cloud = of_lasers.as_flattened().contains(&entry.topic);
        summary.clouds += u64::from(is_cloud);
    }
    for sample in block.epochs {
        truth.pose(sample)?;
        summary.ins_epochs += 1;
    }
    Ok(())
}

/// The topics as their publishers offer them.
fn topic_specs(scans: bool) -> Vec<TopicSpec> {
    let reliable = |depth| BagQos {
        depth,
        ..BagQos::default()
    };
    let mut specs: Vec<_> = Laser::ALL
        .map(|laser| match scans {
            true => spec::<LaserScan>(scan_topic(laser), reliable(20)),
            false => spec::<PointCloud2>(points_topic(laser), reliable(20)),
        })
        .into();
    specs.push(spec::<INSPVAX>(INSPVAX_TOPIC, reliable(100)));
    specs.push(spec::<Odometry>(ODOMETRY_TOPIC, reliable(100)));
    specs.push(spec::<TFMessage>(TF_TOPIC, reliable(100)));
    let latched = BagQos {
        latched: true,
        ..reliable(1)
    };
    specs.push(spec::<TFMessage>(TF_STATIC_TOPIC, latched));
    specs
}

pub(super) fn spec<M: RosMessage>(name: &str, qos: BagQos) -> TopicSpec {
    TopicSpec {
        name: name.to_owned(),
        type_name: M::TYPE.to_owned(),
        type_hash: hash_of(M::TYPE).unwrap_or_default().to_owned(),
        definition: Some(M::definition()),
        offered_qos: vec![qos],
    }
}

/// Files of an earlier log at `out` with its truth, which are replaced; anything else there is refused.
fn earlier(out: &Path, overwrite: bool) -> Result<Vec<PathBuf>, AnyError> {
    let mut files = replaceable(out, overwrite, &[truth::FOLDER])?;
    let folder = out.join(truth::FOLDER);
    if !folder.exists() {
        return Ok(files);
    }
    if !overwrite {
        let words = "there is a log already; choose another directory or allow to overwrite it";
        return Err(at(out)(words));
    }
    for entry in fs::read_dir(&folder).map_err(at(&folder))? {
        let path = entry.map_err(at(&folder))?.path();
        let mut known = truth::FILES.iter();
        if !known.any(|&name| path.file_name() == Some(name.as_ref())) {
            let words = "not written by a simulation and not overwritten; move it or choose another directory";
            return Err(at(&path)(words));
        }
        files.push(path);
    }
    Ok(files)
}

/// Puts a whole log in the place of an earlier one.
fn replace(out: &Path, earlier: &[PathBuf], whole: &Path) -> Result<(), AnyError> {
    for path in earlier {
        fs::remove_file(path).map_err(at(path))?;
    }
    let folder = out.join(truth::FOLDER);
    if folder.exists() {
        fs::remove_dir(&folder).map_err(at(&folder))?;
    }
    fs::rename(whole, out).map_err(at(out))
}
