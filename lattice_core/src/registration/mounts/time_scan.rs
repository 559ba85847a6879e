//! Constant error of the times of points, found by the number of occupied voxels at offsets up to 40 s.
//!
//! That number depends on the way that the machine takes at an offset, and is least where it stands. The right offset has a
//! dip of its own: fewer voxels than half a second to one and a half before and behind it.

use nalgebra::{Isometry3, Vector3};
use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};

use super::{BasePose, MountSamples};
use crate::lattice::{Lattice, LatticeKind};
use crate::pose::{PoseBuffer, PoseBufferOptions};

/// Range of the scan, seconds: beyond the 37 s from UTC to TAI.
const RANGE_S: f64 = 40.0;
/// Step of the scan, seconds.
const STEP_S: f64 = 0.1;
/// Standard deviation of an offset of the scan alone, seconds.
pub(super) const SIGMA_S: f64 = 0.5 * STEP_S;
/// Largest delay of a driver, seconds: a larger offset is that of another clock.
pub const MAX_DELAY_S: f64 = 1.0;
/// Time between a dip and the offsets that it is compared with, and behind them, in steps.
const BESIDE: [usize; 2] = [5, 15];
/// Time from a dip to others, seconds.
const APART_S: f64 = 2.0;
/// Smallest depth of a dip, in standard deviations of all depths and as part of the voxels: true dips of simulated
/// loaders, streets, halls and yards have 4.2 to 8 standard deviations and 0.13 to 0.4, others up to 2.6 and 0.08.
const LEAST_DEPTH: [f64; 2] = [4.0, 0.1];
/// Largest depth of another dip, and of one at no offset, as part of that of the deepest one. Another lap of a circuit
/// has up to 0.88.
const OTHER_DEPTH: [f64; 2] = [0.95, 0.5];
/// Smallest part of the points that have a pose at an offset.
const LEAST_PART: f64 = 0.4;
/// Range of cell sizes, metres; the machine moves by about a cell in a step.
const CELLS_M: [f64; 2] = [2.0, 4.0];
/// Most points of a scan, of a first one and of one that decides.
const MAX_POINTS: [usize; 2] = [10_000, 40_000];
/// Time within which points share a pose, nanoseconds: a machine at 20 m/s moves by a tenth of a cell.
const POSE_NS: i64 = 10_000_000;
/// Longest time between two poses that is interpolated, seconds.
const MAX_GAP_S: f64 = 0.5;

/// Offset added to the times of points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Offset {
    /// None that is better than no offset.
    Nothing,
    /// An offset of a delay, to be refined and compared with none, seconds.
    Near(f64),
    /// An offset of another clock, to a tenth of a second.
    Far(f64),
}

/// Samples, prepared for any offset.
struct Scan<'a> {
    way: &'a PoseBuffer,
    /// Times of the poses, nanoseconds.
    times_ns: Vec<i64>,
    points: Vec<(usize, Vector3<f64>)>,
}

impl<'a> Scan<'a> {
    fn new(samples: &MountSamples, way: &'a PoseBuffer, max_points: usize) -> Scan<'a> {
        let stride = samples.points.len().div_ceil(max_points).max(1);
        let (mut places, mut times_ns) = (FxHashMap::default(), Vec::new());
        let mut points = Vec::new();
        for (place, point) in samples.points.iter().step_by(stride) {
            let Some(pose) = samples.poses.get(*place as usize) else {
                continue;
            };
            let bin = ns(pose.stamp_s).div_euclid(POSE_NS);
            let place = *places.entry(bin).or_insert_with(|| {
                times_ns.push(bin.saturating_mul(POSE_NS).saturating_add(POSE_NS / 2));
                times_ns.len() - 1
            });
            points.push((place, *point));
        }
        Scan {
            way,
            times_ns,
            points,
        }
    }

    /// Points that have a pose with an offset, and the voxels that they occupy.
    fn count(&self, offset_s: f64, cell_m: f64) -> (usize, usize) {
        let Ok(lattice) = Lattice::new(LatticeKind::Fcc, cell_m.powi(3)) else {
            return (0, 0);
        };
        let at = |time_ns: &i64| self.way.at(time_ns.saturating_add(ns(offset_s))).ok();
        let poses: Vec<Option<Isometry3<f64>>> = self.times_ns.iter().map(at).collect();
        let (mut used, mut cells) = (0, FxHashSet::default());
        for (place, point) in &self.points {
            if let Some(Some(pose)) = poses.get(*place) {
                used += 1;
                cells.extend(lattice.quantize(&pose.transform_point(&(*point).into()).coords));
            }
        }
        (used, cells.len())
    }

    /// Voxels of each point at the multiples of a step; infinite where few points have a pose, or none a voxel.
    fn voxels(&self, steps: i32, step_s: f64, about_s: f64, cell_m: f64) -> Vec<f64> {
        let least = LEAST_PART * self.points.len() as f64;
        let counts = (-steps..=steps).into_par_iter().map(|step| {
            match self.count(about_s + f64::from(step) * step_s, cell_m) {
                (used, voxels) if voxels > 0 && used as f64 >= least => voxels as f64 / used as f64,
                _ => f64::INFINITY,
            }
        });
        counts.collect()
    }

    /// Offset with the fewest voxels among `steps` before and behind one, seconds.
    fn least(&self, about_s: f64, steps: i32, step_s: f64, cell_m: f64) -> f64 {
        let voxels = self.voxels(steps, step_s, about_s, cell_m);
        let least = voxels.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1));
        let at = least.map_or(0.0, |(at, _)| at as f64 - f64::from(steps));
        about_s + at * step_s
    }

    /// Offset with the deepest dip, if it stands out from all others and from none, seconds.
    fn deepest(&self, cell_m: f64) -> Option<f64> {
        let steps = (RANGE_S / STEP_S) as i32;
        let depths = depths(&self.voxels(steps, STEP_S, 0.0, cell_m));
        let all = depths.iter().enumerate();
        let all = all.map(|(at, depth)| ((at as f64 - f64::from(steps)) * STEP_S, *depth));
        let all: Vec<(f64, f64)> = all.filter(|(_, depth)| *depth != 0.0).collect();
        let deepest = |of: &dyn Fn(f64) -> bool| {
            let of = all.iter().filter(|(offset_s, _)| of(*offset_s));
            of.copied().max_by(|a, b| a.1.total_cmp(&b.1))
        };
        let depth = |of: &dyn Fn(f64) -> bool| deepest(of).map_or(0.0, |(_, depth)| depth);
        let mut sizes: Vec<f64> = all.iter().map(|(_, depth)| depth.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        // Standard deviation of a normal distribution by its median.
        let sigma = 1.4826 * sizes.get(sizes.len() / 2)?;
        let (best_s, best) = deepest(&|_| true)?;
        let [least_sigmas, least] = LEAST_DEPTH;
        if best < least_sigmas * sigma || best < least {
            return None;
        }
        if best_s.abs() <= MAX_DELAY_S {
            return Some(best_s);
        }
        let other = depth(&|offset_s| (offset_s - best_s).abs() > APART_S);
        let stated = depth(&|offset_s| offset_s.abs() < 1.5 * STEP_S);
        let [most_other, most_stated] = OTHER_DEPTH;
        (other < most_other * best && stated < most_stated * best).then_some(best_s)
    }
}

/// Offset that the samples show.
pub(super) fn search(samples: &MountSamples) -> Offset {
    let mut speeds: Vec<f64> = (samples.poses.iter())
        .map(|pose| pose.velocity_m_per_s.norm())
        .collect();
    speeds.sort_by(f64::total_cmp);
    let fast = speeds.get(speeds.len() * 9 / 10).copied().unwrap_or(0.0);
    let cell_m = (fast * STEP_S).clamp(CELLS_M[0], CELLS_M[1]);
    let [few, most] = MAX_POINTS;
    let way = way(samples);
    let scan = Scan::new(samples, &way, most);
    let refined = |about_s: f64| scan.least(about_s, 5, 0.2 * STEP_S, 0.5 * cell_m);
    // Few points are enough where the stated times are right.
    let is_near =
        |offset: &Option<f64>| offset.is_some_and(|offset_s| offset_s.abs() <= MAX_DELAY_S);
    let quick = Some(Scan::new(samples, &way, few).deepest(cell_m)).filter(is_near);
    match quick.unwrap_or_else(|| scan.deepest(cell_m)) {
        None => Offset::Nothing,
        Some(offset_s) if offset_s.abs() <= MAX_DELAY_S => {
            let near = (MAX_DELAY_S / STEP_S) as i32;
            Offset::Near(refined(scan.least(0.0, near, STEP_S, cell_m)))
        }
        Some(offset_s) => Offset::Far(refined(offset_s)),
    }
}

/// Part by which each number is lower than the means before and behind it; 0 where these are unknown.
fn depths(voxels: &[f64]) -> Vec<f64> {
    let mean = |of: Option<&[f64]>| {
        let of = of?;
        let mean = of.iter().sum::<f64>() / of.len() as f64;
        mean.is_finite().then_some(mean)
    };
    let [from, to] = BESIDE;
    let depth = |(at, voxels_here): (usize, &f64)| {
        let before = at
            .checked_sub(to)
            .and_then(|first| voxels.get(first..=at - from));
        let behind = voxels.get(at + from..=at + to);
        match (mean(before), mean(behind)) {
            (Some(before), Some(behind)) if voxels_here.is_finite() => {
                1.0 - voxels_here / before.min(behind)
            }
            _ => 0.0,
        }
    };
    voxels.iter().enumerate().map(depth).collect()
}

/// Samples without and with an offset added to their times; points without a pose then are left out of both.
pub(super) fn moved(samples: &MountSamples, offset_s: f64) -> [MountSamples; 2] {
    let way = way(samples);
    let mut pair = [(); 2].map(|()| MountSamples {
        sensor_m: samples.sensor_m,
        ..MountSamples::default()
    });
    let [stated, moved] = &mut pair;
    let mut places = Vec::with_capacity(samples.poses.len());
    for pose in &samples.poses {
        let at_ns = ns(pose.stamp_s).saturating_add(ns(offset_s));
        let found = BasePose::at(at_ns, |at_ns| way.at(at_ns).ok());
        places.push(found.map(|found| {
            let stamp_s = pose.stamp_s;
            stated.poses.push(*pose);
            moved.poses.push(BasePose { stamp_s, ..found });
            moved.poses.len() as u32 - 1
        }));
    }
    for (place, point) in &samples.points {
        if let Some(place) = places.get(*place as usize).copied().flatten() {
            stated.points.push((place, *point));
            moved.points.push((place, *point));
        }
    }
    pair
}

fn way(samples: &MountSamples) -> PoseBuffer {
    let mut way = PoseBuffer::new(PoseBufferOptions {
        span_s: f64::MAX,
        max_gap_s: MAX_GAP_S,
        max_poses: samples.way.len(),
        ..PoseBufferOptions::default()
    });
    for pose in &samples.way {
        way.insert(*pose);
    }
    way
}

fn ns(s: f64) -> i64 {
    (s * 1e9).round() as i64
}
