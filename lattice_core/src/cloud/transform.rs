//! Deskew: every point into the map with the pose of its own time.

use nalgebra::{Isometry3, Point3, Vector3};
use rayon::prelude::*;

use super::{CloudView, NO_TIME_NS};

/// Points of one task, at least, and tasks of one thread: enough to share the work evenly.
const MIN_CHUNK: usize = 2048;
const CHUNKS_PER_THREAD: usize = 4;
/// Times remembered while looking for equal ones, as a power of two: many more than the
/// columns of a spinning laser.
const MEMO_BITS: u32 = 15;

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
    /// Indices of the points kept out for any reason, ascending.
    pub left_out: Vec<usize>,
}

/// Brings the points of `view` into the map: point `i` by `map_from_sensor(times[i])`, or
/// all by `map_from_sensor(stamp_ns)` where `times` is `None`. Points without a time there
/// are left out and counted.
///
/// Runs on rayon; the order and the bits of the result do not depend on the number of
/// threads. Poses of times that come again are looked up once. Fails as a whole with the
/// error of the first point kept, in order, whose pose is missing.
pub fn transform_points<E: Send>(
    view: &CloudView<'_>,
    stamp_ns: i64,
    times: Option<&[i64]>,
    range: &RangeLimits,
    map_from_sensor: impl Fn(i64) -> Result<Isometry3<f64>, E> + Sync,
) -> Result<Transformed, E> {
    if view.is_empty() {
        return Ok(Transformed::default());
    }
    let Some(times) = times else {
        let shared = map_from_sensor(stamp_ns).ok();
        return transform(view, range, |_| {
            Some(shared.map_or_else(|| map_from_sensor(stamp_ns), Ok))
        });
    };
    let time_of = |i| times.get(i).copied().filter(|at| *at != NO_TIME_NS);
    match Memo::new(times, &map_from_sensor) {
        Some(memo) => transform(view, range, |i| {
            let at_ns = time_of(i)?;
            Some(memo.pose(i).map_or_else(|| map_from_sensor(at_ns), Ok))
        }),
        None => transform(view, range, |i| Some(map_from_sensor(time_of(i)?))),
    }
}

/// Transforms in parallel by `pose_of` a point, which is `None` where it has no time.
fn transform<E: Send>(
    view: &CloudView<'_>,
    range: &RangeLimits,
    pose_of: impl Fn(usize) -> Option<Result<Isometry3<f64>, E>> + Sync,
) -> Result<Transformed, E> {
    let chunk = view
        .len()
        .div_ceil(rayon::current_num_threads() * CHUNKS_PER_THREAD)
        .max(MIN_CHUNK);
    // Collected before the first error is taken, so that it is the first in order.
    let parts: Vec<Result<Transformed, E>> = (0..view.len().div_ceil(chunk))
        .into_par_iter()
        .map(|part| {
            let first = part * chunk;
            transform_part(view, first..view.len().min(first + chunk), range, &pose_of)
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
        all.left_out.extend(part.left_out);
    }
    Ok(all)
}

fn transform_part<E>(
    view: &CloudView<'_>,
    indices: std::ops::Range<usize>,
    range: &RangeLimits,
    pose_of: &impl Fn(usize) -> Option<Result<Isometry3<f64>, E>>,
) -> Result<Transformed, E> {
    let mut out = Transformed {
        points_m: Vec::with_capacity(indices.len()),
        ..Transformed::default()
    };
    for i in indices {
        let p = view.xyz(i);
        let distance_m = p.norm();
        if !distance_m.is_finite() {
            out.not_finite += 1;
        } else if !(distance_m > range.min_range_m && distance_m <= range.max_range_m) {
            out.out_of_range += 1;
        } else if let Some(pose) = pose_of(i) {
            out.points_m.push((pose? * Point3::from(p)).coords);
            continue;
        } else {
            out.no_time += 1;
        }
        out.left_out.push(i);
    }
    Ok(out)
}

/// Poses of the times that a cloud repeats: column by column, or row by row where the times
/// of a row come again in the next.
struct Memo {
    /// Number of the pose of each point.
    slots: Vec<u32>,
    /// Poses found; the misses are asked for again, to have their errors.
    poses: Vec<Option<Isometry3<f64>>>,
}

impl Memo {
    /// `None` if the times hardly repeat.
    fn new<E: Send>(
        times: &[i64],
        map_from_sensor: &(impl Fn(i64) -> Result<Isometry3<f64>, E> + Sync),
    ) -> Option<Memo> {
        let mut distinct_ns: Vec<i64> = Vec::new();
        let mut slots = Vec::with_capacity(times.len());
        // Direct mapped: two times of one place displace each other and are merely asked
        // for again, so that no choice of times makes it slow.
        let mut seen = vec![(NO_TIME_NS, 0_u32); 1 << MEMO_BITS];
        for &at_ns in times {
            // Fibonacci hashing: the high bits of the product mix all bits of the time.
            let hash = (at_ns as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
            let place = seen.get_mut((hash >> (u64::BITS - MEMO_BITS)) as usize)?;
            if place.0 != at_ns {
                if distinct_ns.len() > times.len() / 4 {
                    return None;
                }
                *place = (at_ns, u32::try_from(distinct_ns.len()).ok()?);
                distinct_ns.push(at_ns);
            }
            slots.push(place.1);
        }
        let poses = distinct_ns
            .par_iter()
            .with_min_len(64)
            .map(|at_ns| map_from_sensor(*at_ns).ok())
            .collect();
        Some(Memo { slots, poses })
    }

    fn pose(&self, i: usize) -> Option<Isometry3<f64>> {
        *self.poses.get(*self.slots.get(i)? as usize)?
    }
}
