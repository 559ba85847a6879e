//! The log of a lidar that moves through a scene, with the true poses beside it.
//!
//! The topic `/points` has x, y, z (f32) and t (u32, ns since the stamp) in the frame `lidar`. No topic has poses, so that
//! a replay takes those of lidar odometry. `truth.tum` in the log's directory has the true pose of `lidar` every 10 ms.

use std::fmt;
use std::fs;
use std::path::PathBuf;

use lattice_bag::{BagQos, BagWriter, Storage, WriterOptions, replaceable};
use lattice_msgs::cdr;
use lattice_msgs::sensor_msgs::{PointCloud2, PointField};
use lattice_nodes::convert::cloud::{dense_cloud, field, xyz_fields};
use lattice_nodes::convert::geometry::header;
use lattice_nodes::files::atomic_write;
use serde::Serialize;

use super::facts::bobcat_start_ns;
use super::write::spec;
use crate::poses::tum_line;
use crate::simulate::drive::{Drive, DriveScan, DriveScene};
use crate::{AnyError, at};

/// File of the true poses in the directory of the log.
pub const TRUTH_FILE: &str = "truth.tum";
const TOPIC: &str = "/points";
const FRAME: &str = "lidar";
/// Bytes of a point: x, y, z (f32) and t (u32).
const POINT_STEP: u32 = 16;
/// Time between true poses, ns.
const TRUTH_NS: usize = 10_000_000;

/// Options of a simulated log.
#[derive(Clone, Debug)]
pub struct DriveLogOptions {
    /// Directory of the log.
    pub out: PathBuf,
    /// True to replace an earlier log.
    pub overwrite: bool,
    /// Scene.
    pub scene: DriveScene,
    /// Seed of the scene and the noise.
    pub seed: u64,
    /// Duration of the log, s; `None`: the whole drive.
    pub duration_s: Option<f64>,
}

/// Summary of a written log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DriveLogSummary {
    /// Directory of the log.
    pub out: PathBuf,
    /// Number of scans.
    pub scans: u64,
    /// Number of points of all scans.
    pub points: u64,
    /// File of the true poses.
    pub truth: PathBuf,
}

impl fmt::Display for DriveLogSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (out, truth) = (self.out.display(), self.truth.display());
        write!(
            f,
            "{out}: {} scans with {} points, truth in {truth}",
            self.scans, self.points
        )
    }
}

/// Simulates a drive through a scene, and writes the log as a rosbag2 directory with the true poses in it. `progress`
/// gets the completed fraction.
pub fn write_drive(
    options: &DriveLogOptions,
    progress: &mut dyn FnMut(f64),
) -> Result<DriveLogSummary, AnyError> {
    let duration_s = options.duration_s.unwrap_or(f64::INFINITY);
    if duration_s.is_nan() || duration_s < 0.1 {
        return Err(format!("a log of {duration_s} s has no scan; each takes 0.1 s").into());
    }
    let truth = options.out.join(TRUTH_FILE);
    replaceable(&options.out, options.overwrite, &[TRUTH_FILE])?;
    if truth.exists() {
        match options.overwrite {
            true => fs::remove_file(&truth).map_err(at(&truth))?,
            false => {
                return Err(at(&truth)(
                    "exists; choose another directory or allow to overwrite",
                ));
            }
        }
    }
    let writer = WriterOptions {
        overwrite: options.overwrite,
        ..WriterOptions::default()
    };
    let mut bag = BagWriter::create(&options.out, Storage::Mcap, writer)?;
    let topic = bag.add_topic(spec::<PointCloud2>(TOPIC, BagQos::default()))?;

    let drive = Drive::new(options.scene, options.seed);
    let last = drive.scans().last().unwrap_or(1);
    let mut summary = DriveLogSummary {
        out: options.out.clone(),
        scans: 0,
        points: 0,
        truth,
    };
    let mut end_ns = 0;
    for number in drive.scans() {
        let scan = drive.scan(number);
        if scan.end_ns as f64 * 1e-9 > duration_s {
            break;
        }
        end_ns = scan.end_ns;
        let log_time_ns = bobcat_start_ns().saturating_add(end_ns);
        bag.write(topic, log_time_ns, &cdr::to_vec(&cloud(&scan))?)?;
        summary.scans += 1;
        summary.points += scan.points_m.len() as u64;
        progress(number as f64 / last as f64);
    }
    bag.finish()?;
    let times_ns = (0..=end_ns).step_by(TRUTH_NS);
    let lines = times_ns.map(|time_ns| {
        let stamp_ns = bobcat_start_ns().saturating_add(time_ns);
        tum_line(stamp_ns, &drive.pose(time_ns))
    });
    atomic_write::write_text(&summary.truth, &lines.collect::<String>())?;
    Ok(summary)
}

/// Message of a scan as a driver publishes it, stamped with the time of its first shot.
fn cloud(scan: &DriveScan) -> PointCloud2 {
    let first_ns = scan.times_ns.first().copied().unwrap_or(scan.end_ns);
    let mut fields = xyz_fields(PointField::FLOAT32, 4);
    fields.push(field("t", 12, PointField::UINT32));
    let mut data = Vec::with_capacity(scan.points_m.len() * POINT_STEP as usize);
    for (point_m, time_ns) in scan.points_m.iter().zip(&scan.times_ns) {
        for value in point_m {
            data.extend_from_slice(&(*value as f32).to_le_bytes());
        }
        let since_ns = u32::try_from(time_ns.saturating_sub(first_ns)).unwrap_or(u32::MAX);
        data.extend_from_slice(&since_ns.to_le_bytes());
    }
    let stamp = header(FRAME, bobcat_start_ns().saturating_add(first_ns));
    dense_cloud(stamp, fields, POINT_STEP, scan.points_m.len(), data)
}
