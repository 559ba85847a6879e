//! Deskew: every point into the map with the pose of its own time.

use nalgebra::{Isometry3, Point3, Vector3};
use rayon::prelude::*;

use super::{CloudView, NO_TIME_NS};

/// Points of one task: large enough for its cache of poses to pay, small enough to share.
const MIN_CHUNK: usize = 2048;
const CHUNKS_PER_THREAD: usize = 4;
/// Poses remembered per task, a power of two: more than the columns of a spinning laser.
const CACHE_SLOTS: usize = 4096;

/// Distances kept, in the sensor frame: `min_range_m < distance <= max_range_m`, so that
/// the sensor's origin, which many drivers send for no return, is never kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeLimits {
    /// Greatest distance too short, metres.
    pub min_range_m: f64,
    /// Greatest distance kept, metres.
    pub max_range_m: f64,
}

impl Default for RangeLimits {
    fn default() -> RangeLimits {
        RangeLimits {
            min_range_m: 0.0,
            max_range_m: f64::INFINITY,
        }
    }
}

/// Points in the map, in the order of the cloud, and what was kept out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Transformed {
    /// Points in the map frame, metres.
    pub points_m: Vec<Vector3<f64>>,
    /// Points with a NaN or infinite coordinate.
    pub not_finite: usize,
    /// Finite points nearer or further than the limits.
    pub out_of_range: usize,
    /// Points within range that have no time.
    pub no_time: usize,
}

/// Brings the points of `view` into the map: point `i` by `map_from_sensor(times[i])`, or
/// all by `map_from_sensor(stamp_ns)` where `times` is `None`.
///
/// Runs on rayon; the order and the bits of the result do not depend on the number of
/// threads. A pose is asked for only where a point is kept, and at most once per run of
/// equal times. Fails as a whole with the error of the first point, in order, whose pose is
/// missing.
pub fn transform_points<E: Send>(
    view: &CloudView<'_>,
    stamp_ns: i64,
    times: Option<&[i64]>,
    range: &RangeLimits,
    map_from_sensor: impl Fn(i64) -> Result<Isometry3<f64>, E> + Sync,
) -> Result<Transformed, E> {
    let chunk = view
        .len()
        .div_ceil(rayon::current_num_threads() * CHUNKS_PER_THREAD)
        .max(MIN_CHUNK);
    let parts: Vec<Result<Transformed, E>> = (0..view.len().div_ceil(chunk))
        .into_par_iter()
        .map(|part| {
            let first = part * chunk;
            let last = view.len().min(first + chunk);
            transform_part(view, first..last, stamp_ns, times, range, &map_from_sensor)
        })
        .collect();
    let parts = parts.into_iter().collect::<Result<Vec<_>, E>>()?;
    let mut all = Transformed {
        points_m: Vec::with_capacity(parts.iter().map(|p| p.points_m.len()).sum()),
        ..Transformed::default()
    };
    for part in parts {
        all.points_m.extend_from_slice(&part.points_m);
        all.not_finite += part.not_finite;
        all.out_of_range += part.out_of_range;
        all.no_time += part.no_time;
    }
    Ok(all)
}

fn transform_part<E>(
    view: &CloudView<'_>,
    indices: std::ops::Range<usize>,
    stamp_ns: i64,
    times: Option<&[i64]>,
    range: &RangeLimits,
    map_from_sensor: &impl Fn(i64) -> Result<Isometry3<f64>, E>,
) -> Result<Transformed, E> {
    let mut out = Transformed {
        points_m: Vec::with_capacity(indices.len()),
        ..Transformed::default()
    };
    let mut poses = PoseCache::new(if times.is_some() { indices.len() } else { 1 });
    for i in indices {
        let p = view.xyz(i);
        let distance_m = p.norm();
        if !distance_m.is_finite() {
            out.not_finite += 1;
            continue;
        }
        if !(distance_m > range.min_range_m && distance_m <= range.max_range_m) {
            out.out_of_range += 1;
            continue;
        }
        let time_ns = match times {
            None => stamp_ns,
            Some(times) => times.get(i).copied().unwrap_or(NO_TIME_NS),
        };
        if times.is_some() && time_ns == NO_TIME_NS {
            out.no_time += 1;
            continue;
        }
        let pose = poses.at(time_ns, map_from_sensor)?;
        out.points_m.push((pose * Point3::from(p)).coords);
    }
    Ok(out)
}

/// Poses by time, direct mapped: it serves runs of equal times as well as row-major clouds,
/// where the times of a row come again in the next.
struct PoseCache {
    slots: Vec<Option<(i64, Isometry3<f64>)>>,
    shift: u32,
}

impl PoseCache {
    fn new(points: usize) -> PoseCache {
        let slots = points.next_power_of_two().clamp(1, CACHE_SLOTS);
        PoseCache {
            slots: vec![None; slots],
            shift: u64::BITS - slots.trailing_zeros(),
        }
    }

    fn at<E>(
        &mut self,
        time_ns: i64,
        map_from_sensor: &impl Fn(i64) -> Result<Isometry3<f64>, E>,
    ) -> Result<Isometry3<f64>, E> {
        // Fibonacci hashing: the high bits of the product mix all bits of the time.
        let hash = (time_ns as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let slot = hash.checked_shr(self.shift).unwrap_or(0) as usize;
        match self.slots.get_mut(slot) {
            Some(Some((at_ns, pose))) if *at_ns == time_ns => Ok(*pose),
            Some(entry) => {
                let pose = map_from_sensor(time_ns)?;
                *entry = Some((time_ns, pose));
                Ok(pose)
            }
            None => map_from_sensor(time_ns),
        }
    }
}
