//! Pairs of scans and the results of each method on them.

use super::methods::KittiMethod;
use super::scans::Scan;
use crate::AnyError;
use crate::bench::timed;
use crate::evaluate::global_registration;
use crate::evaluate::trial::{Bounds, rounded};
use crate::metrics::PoseError;
use lattice_core::registration::{
    CalibrationMap, PrepareOptions, PreparedCloud, Profile, SemanticCloud, SourceCloud, register,
    voxel_downsample,
};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use serde::Serialize;

/// Error bounds of a correct pose: 0.15 m and 0.3 degrees.
pub const RIGHT: Bounds = Bounds { m: 0.15, deg: 0.3 };

/// Two scans, of which the first is moved.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Pair {
    /// Number of the scan that is moved.
    pub source: usize,
    /// Number of the scan that stays.
    pub target: usize,
    /// Distance of their sensors, metres.
    pub distance_m: f64,
    /// True transform, row by row.
    pub target_from_source: [[f64; 4]; 4],
    /// Start: no translation and the true heading.
    pub start: [[f64; 4]; 4],
    #[serde(skip)]
    truth: Isometry3<f64>,
    #[serde(skip)]
    heading: Isometry3<f64>,
}

/// Result of a method on a pair.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct PairRow {
    /// Name of the method.
    pub method: String,
    /// Name of the method in tables.
    pub title: String,
    /// Start: `heading` with the true heading, `none` for none; methods that need one
    /// start at the identity there.
    pub start: String,
    /// Number of the scan that is moved.
    pub source: usize,
    /// Number of the scan that stays.
    pub target: usize,
    /// Distance of the origin from the truth, metres.
    pub translation_m: f64,
    /// Angle from the truth, degrees.
    pub rotation_deg: f64,
    /// True if both are within the bounds.
    pub right: bool,
    /// Verdict of a method that judges its own result.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub verdict: Option<String>,
    /// Log-likelihood above the best different pose, if it was asked and there was one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub margin: Option<f64>,
    /// Processor time from thinned points in memory to the start of the method, milliseconds.
    pub prepare_ms: f64,
    /// Processor time from there to the result, milliseconds.
    pub register_ms: f64,
}

/// Results of all pairs and methods.
#[derive(Clone, Default, PartialEq, Debug, Serialize)]
pub struct KittiReport {
    /// Side of the cells of the thinning, metres.
    pub cell_m: f64,
    /// Profile that the program was built in, `release` or `dev`.
    pub build: String,
    /// Threads of all that is ours.
    pub threads: usize,
    /// Bounds of a right pose: metres.
    pub right_m: f64,
    /// Bounds of a right pose: degrees.
    pub right_deg: f64,
    /// Names of the scans.
    pub scans: Vec<String>,
    /// Points of each, all and thinned.
    pub points: Vec<[usize; 2]>,
    /// All ordered pairs.
    pub pairs: Vec<Pair>,
    /// Results of all methods.
    pub rows: Vec<PairRow>,
}

/// A scan, thinned and made ready.
pub struct Prepared {
    /// All points.
    pub whole: SemanticCloud,
    /// The means of the cells.
    pub thinned: SemanticCloud,
    /// Cloud of single registrations.
    pub cloud: PreparedCloud,
    /// Map of ours.
    pub map: CalibrationMap,
    cloud_ms: f64,
    map_ms: f64,
}

impl Prepared {
    /// Thins to the means of cubes of side `cell_m`.
    pub fn new(scan: &Scan, cell_m: f64) -> Result<Prepared, AnyError> {
        let thinned = voxel_downsample(&scan.cloud, cell_m);
        let options = PrepareOptions::default();
        let (cloud, cloud_spent) = timed(|| PreparedCloud::new(thinned.clone(), &options));
        let (map, map_spent) = timed(|| CalibrationMap::new(thinned.clone(), cell_m));
        Ok(Prepared {
            whole: scan.cloud.clone(),
            thinned,
            cloud: cloud?,
            map: map?,
            cloud_ms: 1e3 * cloud_spent.cpu_s,
            map_ms: 1e3 * map_spent.cpu_s,
        })
    }
}

/// All ordered pairs.
pub fn pairs_of(scans: &[Scan]) -> Vec<Pair> {
    let mut pairs = Vec::new();
    for (target, to) in scans.iter().enumerate() {
        for (source, from) in scans.iter().enumerate() {
            if source != target {
                let truth = to.map_from_sensor.inverse() * from.map_from_sensor;
                pairs.push(Pair::new(source, target, truth));
            }
        }
    }
    pairs
}

impl Pair {
    fn new(source: usize, target: usize, truth: Isometry3<f64>) -> Pair {
        let (_, _, yaw) = truth.rotation.euler_angles();
        let turn = UnitQuaternion::from_scaled_axis(Vector3::z() * yaw);
        let heading = Isometry3::from_parts(Vector3::zeros().into(), turn);
        Pair {
            source,
            target,
            distance_m: truth.translation.vector.norm(),
            target_from_source: matrix(&truth),
            start: matrix(&heading),
            truth,
            heading,
        }
    }

    /// Result of a method; `scans` are those of the numbers. None without such scans.
    pub fn run(&self, method: &KittiMethod, known: bool, scans: &[Prepared]) -> Option<PairRow> {
        let (source, target) = (scans.get(self.source)?, scans.get(self.target)?);
        let start = known.then_some(self.heading);
        let from = start.unwrap_or_default();
        let row = |pose: &Isometry3<f64>, prepare_ms| self.row(method, known, pose, prepare_ms);
        Some(match method {
            KittiMethod::Start => row(&from, 0.0),
            KittiMethod::Single(named, gate_m) => {
                let options = named.options(*gate_m);
                let (found, spent) =
                    timed(|| register(&source.cloud, &target.cloud, &from, &options));
                PairRow {
                    register_ms: 1e3 * spent.cpu_s,
                    ..row(&found.target_from_source, source.cloud_ms + target.cloud_ms)
                }
            }
            KittiMethod::Ours { thinned } => {
                let cloud = match thinned {
                    true => &source.thinned,
                    false => &source.whole,
                };
                let headset_scans = [SourceCloud {
                    cloud: cloud.clone(),
                    sensor_m: Some(Point3::origin()),
                }];
                let options = Profile::Lidar.options();
                let (found, spent) = timed(|| {
                    global_registration::register(&target.map, &headset_scans, start, &options)
                });
                PairRow {
                    register_ms: 1e3 * spent.cpu_s,
                    verdict: Some(found.verdict.name().to_owned()),
                    margin: Some(rounded(found.margin.log_ratio)).filter(|m| m.is_finite()),
                    ..row(&found.target_from_source, target.map_ms)
                }
            }
        })
    }

    fn row(
        &self,
        method: &KittiMethod,
        known: bool,
        pose: &Isometry3<f64>,
        prepare_ms: f64,
    ) -> PairRow {
        let error = PoseError::between(pose, &self.truth);
        let rotation_deg = error.rotation_rad.to_degrees();
        PairRow {
            method: method.name(),
            title: method.title(),
            start: if known { "heading" } else { "none" }.to_owned(),
            source: self.source,
            target: self.target,
            translation_m: rounded(error.translation_m),
            rotation_deg: rounded(rotation_deg),
            right: error.translation_m <= RIGHT.m && rotation_deg <= RIGHT.deg,
            verdict: None,
            margin: None,
            prepare_ms,
            register_ms: 0.0,
        }
    }
}

fn matrix(pose: &Isometry3<f64>) -> [[f64; 4]; 4] {
    // nalgebra's arrays are columns.
    pose.to_homogeneous().transpose().into()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scan(at: Isometry3<f64>) -> Scan {
        Scan {
            name: String::new(),
            cloud: SemanticCloud::default(),
            map_from_sensor: at,
        }
    }

    #[test]
    fn pairs_go_both_ways_and_start_with_the_heading_alone() {
        let first = Isometry3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::z() * 0.5);
        let step = Isometry3::new(Vector3::new(4.0, 0.0, 0.0), Vector3::z() * -0.2);
        let pairs = pairs_of(&[scan(first), scan(first * step)]);
        assert_eq!(pairs.len(), 2);
        let pair = &pairs[0];
        assert_eq!((pair.source, pair.target), (1, 0));
        assert!((pair.truth.to_homogeneous() - step.to_homogeneous()).norm() < 1e-12);
        assert!((pair.target_from_source[0][3] - 4.0).abs() < 1e-12);
        assert!((pair.start[0][1] - 0.2_f64.sin()).abs() < 1e-12);
        assert_eq!(pair.start[0][3], 0.0);

        let row = pair.row(&KittiMethod::Start, true, &pair.heading, 0.0);
        assert!((row.translation_m - 4.0).abs() < 1e-6 && row.rotation_deg < 1e-6 && !row.right);
        let close = Isometry3::translation(0.1, 0.0, 0.1) * step;
        let right = |pose| {
            pair.row(&KittiMethod::Ours { thinned: false }, false, pose, 0.0)
                .right
        };
        assert!(right(&close));
        let turned = step * Isometry3::rotation(Vector3::x() * 0.31_f64.to_radians());
        assert!(!right(&turned));
    }
}
