//! Poses of a drive against the truth: errors, verdicts and covariances.

use std::collections::{BTreeMap, BTreeSet};

use lattice_core::loop_closure::{LoopCloser, SegmentCutter};
use lattice_core::odometry::{Odometry, OdometryOptions, Prior, Scan, ScanResult, Verdict};
use nalgebra::{Isometry3, Vector6};
use serde::{Deserialize, Serialize};

use super::loops::{LoopTrial, WRONG_M};
use crate::AnyError;
use crate::bench::{Spent, timed};
use crate::evaluate::statistics::mean;
use crate::simulate::drive::{Drive, DriveScene};

/// Length of the segments over which relative errors are taken, m.
pub(super) const SEGMENT_M: f64 = 10.0;

/// One drive.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OdometryTrial {
    /// Name of the scene, or of the log.
    pub scene: String,
    /// Seed of the scene; 0 of a log.
    pub seed: u64,
    /// Scans, and those of each verdict.
    pub scans: u64,
    /// Poses held in all directions.
    pub ok: u64,
    /// Poses predicted in some directions.
    pub weak: u64,
    /// Poses predicted.
    pub lost: u64,
    /// Clouds refused, without a pose.
    #[serde(default)]
    pub refused: u64,
    /// Poses that are `OK` at times without a truth: they are not measured.
    #[serde(default)]
    pub without_truth: u64,
    /// Submaps begun.
    pub submaps: u64,
    /// Root mean square of the errors of poses that are `OK`, since the beginnings of their submaps, m.
    pub ate_m: f64,
    /// Mean error over segments of 10 m, per cent.
    pub rpe_percent: Option<f64>,
    /// Largest error of a pose that is `OK`, m.
    pub largest_m: f64,
    /// Poses that are `OK` and off by more than 1 m.
    pub wrong: u64,
    /// Poses that are `OK` and off by more than three stated standard deviations.
    pub beyond_3_sigma: u64,
    /// Mean normalized estimation error squared of poses that are `OK`; 6 where covariances are right.
    pub nees: Option<f64>,
    /// Mean wall time of a scan on the threads of the run, ms.
    pub ms: f64,
    /// Mean processor time of a scan, ms, without loops.
    #[serde(default)]
    pub cpu_ms: f64,
    /// Loops, and the poses that they correct.
    #[serde(default)]
    pub loops: LoopTrial,
}

/// A pose with its truth, both since the beginning of the submap.
pub(super) struct Posed {
    result: ScanResult,
    found: Isometry3<f64>,
    truth: Isometry3<f64>,
}

/// Poses of a run against the truth, scan by scan.
#[derive(Default)]
pub(super) struct Measurement {
    pub(super) trial: OdometryTrial,
    spent_s: [f64; 2],
    submaps: BTreeSet<u32>,
    /// First poses of the submaps, found and true.
    begun: BTreeMap<u32, (Isometry3<f64>, Isometry3<f64>)>,
    posed: Vec<Posed>,
    /// Poses that are `OK` with their truths, as they were found.
    pub(super) found: Vec<(ScanResult, Isometry3<f64>)>,
    loops_s: f64,
}

impl Measurement {
    /// Adds the time of a registration.
    pub(super) fn spend(&mut self, spent: Spent) {
        self.spent_s[0] += spent.wall_s;
        self.spent_s[1] += spent.cpu_s;
    }

    /// Adds a scan: its pose with the truth at that time, or none if it was refused.
    pub(super) fn add(&mut self, posed: Option<(ScanResult, Option<Isometry3<f64>>)>) {
        let trial = &mut self.trial;
        trial.scans += 1;
        let Some((result, truth)) = posed else {
            trial.refused += 1;
            return;
        };
        match result.verdict {
            Verdict::Ok => trial.ok += 1,
            Verdict::Weak(_) => trial.weak += 1,
            Verdict::Lost(_) => trial.lost += 1,
        }
        if result.verdict != Verdict::Ok {
            return;
        }
        self.submaps.insert(result.submap);
        let Some(truth) = truth else {
            trial.without_truth += 1;
            return;
        };
        self.found.push((result.clone(), truth));
        let first = (result.odom_from_base, truth);
        let (odom_first, true_first) = self.begun.entry(result.submap).or_insert(first);
        self.posed.push(Posed {
            found: odom_first.inverse() * result.odom_from_base,
            truth: true_first.inverse() * truth,
            // In the axes of the first scan, as the poses are.
            result: turned(result, odom_first),
        });
    }

    /// Registers so many scans of a drive.
    pub(super) fn drive(&mut self, drive: &Drive, scans: usize) -> Result<(), AnyError> {
        let mut odometry = Odometry::new(OdometryOptions::default());
        let (mut cutter, mut loops) = (SegmentCutter::default(), LoopCloser::default());
        for number in drive.scans().take(scans) {
            let scan = drive.scan(number);
            let input = Scan {
                points_m: &scan.points_m,
                times_ns: Some(&scan.times_ns),
                stamp_ns: scan.end_ns,
            };
            let (result, spent) = timed(|| odometry.register(&input, &Prior::default()));
            self.spend(spent);
            let result = result?;
            let side_m = odometry.sizes().map_or(f64::NAN, |sizes| sizes.centroids_m);
            let (closed, spent) =
                timed(
                    || match cutter.add(&result, odometry.centroids_m(), side_m)? {
                        Some(segment) => loops.add(segment).map(|_| ()),
                        None => Ok(()),
                    },
                );
            closed?;
            self.loops_s += spent.cpu_s;
            self.add(Some((result, Some(drive.pose(scan.end_ns)))));
        }
        if let Some(last) = cutter.finish() {
            loops.add(last)?;
        }
        self.trial.loops = LoopTrial::of(&loops, &self.found, self.loops_s);
        Ok(())
    }

    pub(super) fn finish(mut self) -> OdometryTrial {
        let scans = self.trial.scans.max(1) as f64;
        [self.trial.ms, self.trial.cpu_ms] = self.spent_s.map(|all_s| 1e3 * all_s / scans);
        self.trial.submaps = self.submaps.len() as u64;
        self.trial.measure(&self.posed);
        self.trial
    }
}

impl OdometryTrial {
    /// Drives through a scene.
    pub fn run(scene: DriveScene, seed: u64) -> Result<OdometryTrial, AnyError> {
        let mut measurement = Measurement::default();
        measurement.drive(&Drive::new(scene, seed), usize::MAX)?;
        Ok(OdometryTrial {
            scene: scene.name().to_owned(),
            seed,
            ..measurement.finish()
        })
    }

    fn measure(&mut self, posed: &[Posed]) {
        let mut nees = Vec::new();
        let mut squares = 0.0;
        for posed in posed {
            let moved = posed.found.translation.vector - posed.truth.translation.vector;
            let turned = (posed.found.rotation * posed.truth.rotation.inverse()).scaled_axis();
            squares += moved.norm_squared();
            self.largest_m = self.largest_m.max(moved.norm());
            self.wrong += u64::from(moved.norm() > WRONG_M);
            let error = Vector6::new(moved.x, moved.y, moved.z, turned.x, turned.y, turned.z);
            let Some(inverse) = posed.result.covariance.try_inverse() else {
                continue;
            };
            nees.push(error.dot(&(inverse * error)));
            let spread = posed
                .result
                .covariance
                .fixed_view::<3, 3>(0, 0)
                .into_owned();
            let deviation_m = spread.symmetric_eigenvalues().max().sqrt();
            self.beyond_3_sigma += u64::from(moved.norm() > 3.0 * deviation_m);
        }
        self.ate_m = (squares / posed.len().max(1) as f64).sqrt();
        self.nees = mean(&nees);
        self.rpe_percent = mean(&segments(posed)).map(|error_m| 100.0 * error_m / SEGMENT_M);
    }
}

/// A result in the axes of another pose.
fn turned(mut result: ScanResult, axes: &Isometry3<f64>) -> ScanResult {
    let turn = axes.rotation.inverse().to_rotation_matrix();
    let mut both = nalgebra::Matrix6::zeros();
    for at in [0, 3] {
        both.fixed_view_mut::<3, 3>(at, at).copy_from(turn.matrix());
    }
    result.covariance = both * result.covariance * both.transpose();
    result
}

/// Errors of the motion over segments within submaps, m.
fn segments(posed: &[Posed]) -> Vec<f64> {
    let mut errors = Vec::new();
    for (i, from) in posed.iter().enumerate() {
        let mut length_m = 0.0;
        let rest = posed.get(i..).unwrap_or_default();
        let steps = rest.windows(2).filter_map(|pair| match pair {
            [a, b] => Some((a, b)),
            _ => None,
        });
        for (a, b) in steps.take_while(|(_, b)| b.result.submap == from.result.submap) {
            length_m += (b.truth.translation.vector - a.truth.translation.vector).norm();
            if length_m >= SEGMENT_M {
                let found = from.found.inverse() * b.found;
                let truth = from.truth.inverse() * b.truth;
                errors.push((found.translation.vector - truth.translation.vector).norm());
                break;
            }
        }
    }
    errors
}
