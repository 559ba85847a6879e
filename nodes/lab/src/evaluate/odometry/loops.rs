//! Loops of a drive and the poses that they correct, against the truth.

use std::collections::BTreeSet;

use lattice_core::loop_closure::LoopCloser;
use lattice_core::odometry::ScanResult;
use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};

/// Error of a pose that must not be called `OK`, and of a false loop, m.
pub(super) const WRONG_M: f64 = 1.0;

/// Loops of one drive.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LoopTrial {
    /// Loops that were tried.
    pub tried: u64,
    /// Loops that closed.
    pub closed: u64,
    /// Loops that closed and are off by more than 1 m.
    pub wrong: u64,
    /// Root mean square of the errors of corrected poses, since the first one, m; `None` if no loop closed.
    pub ate_m: Option<f64>,
    /// Processor time of all loops, s.
    pub cpu_s: Option<f64>,
}

impl LoopTrial {
    /// Measures the loops of a drive by poses that are `OK`, with their truths.
    pub fn of(loops: &LoopCloser, found: &[(ScanResult, Isometry3<f64>)], cpu_s: f64) -> LoopTrial {
        let closed = loops.attempts().iter().filter(|attempt| attempt.is_closed);
        let truth_at = |stamp_ns: i64| {
            let found = found.iter().find(|(scan, _)| scan.end_ns == stamp_ns);
            found.map(|(_, truth)| *truth)
        };
        let is_wrong = |ends_ns: [i64; 2], from_to: &Isometry3<f64>| {
            let [Some(from), Some(to)] = ends_ns.map(truth_at) else {
                return false;
            };
            let apart = from_to.inverse() * (from.inverse() * to);
            apart.translation.vector.norm() > WRONG_M
        };
        let wrong = closed
            .clone()
            .filter(|one| is_wrong(one.stamps_ns, &one.from_to));
        let count = closed.clone().count();
        LoopTrial {
            tried: loops.attempts().len() as u64,
            closed: count as u64,
            wrong: wrong.count() as u64,
            ate_m: (count > 0).then(|| ate_m(loops, found)).flatten(),
            cpu_s: Some(cpu_s),
        }
    }
}

/// Root mean square of the errors of the largest part that loops join, m.
fn ate_m(loops: &LoopCloser, found: &[(ScanResult, Isometry3<f64>)]) -> Option<f64> {
    let submaps: BTreeSet<u32> = found.iter().map(|(scan, _)| scan.submap).collect();
    let parts = submaps.iter().map(|submap| loops.joined_with(*submap));
    let corrections = loops.corrections();
    let of = |part: &BTreeSet<u32>| -> Vec<(Isometry3<f64>, Isometry3<f64>)> {
        let mapped = found.iter().filter(|(scan, _)| part.contains(&scan.submap));
        let pose = |(scan, truth): &(ScanResult, Isometry3<f64>)| {
            (corrections.map_from_base(scan), *truth)
        };
        mapped.map(pose).collect()
    };
    let poses = parts.map(|part| of(&part)).max_by_key(Vec::len)?;
    let (first, first_truth) = poses.first()?;
    let error = |(pose, truth): &(Isometry3<f64>, Isometry3<f64>)| {
        let (moved, true_moved) = (first.inverse() * pose, first_truth.inverse() * truth);
        (moved.translation.vector - true_moved.translation.vector).norm_squared()
    };
    let squares: f64 = poses.iter().map(error).sum();
    Some((squares / poses.len() as f64).sqrt())
}
