//! Deskewing: transforms every point to the map frame with the pose at its own time, from record to record in one
//! pass.

use nalgebra::{Isometry3, Point3};
use rayon::prelude::*;

use super::record::{Copies, Precision, RecordFormat, write_vector};
use super::{CloudView, NO_TIME_NS};

/// Minimum number of points per task.
const MIN_CHUNK: usize = 2048;
/// Tasks per thread, for an even distribution.
const CHUNKS_PER_THREAD: usize = 4;
/// Size of the table of repeated times, as a power of two: far more than the columns of a spinning lidar.
const MEMO_BITS: u32 = 15;
/// Slot of a point without a time.
const NO_SLOT: u32 = u32::MAX;

/// Range limits in the sensor frame: `min_range_m < distance <= max_range_m`.
///
/// The origin of the sensor, which many drivers send for a missing return, is always dropped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeLimits {
    /// Distance up to which points are dropped, metres.
    pub min_range_m: f64,
    /// Maximum distance, metres.
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

/// Transformed records in the order of the cloud, and the numbers of dropped points.
#[derive(Clone, Debug, PartialEq)]
pub struct Records {
    /// Records as laid out by [`RecordFormat::fields`], coordinates in the map frame in metres.
    pub data: Vec<u8>,
    /// Number of records.
    pub points: usize,
    /// Type of their coordinates.
    pub precision: Precision,
    /// Points with a NaN or infinite coordinate.
    pub not_finite: usize,
    /// Finite points outside the range limits.
    pub out_of_range: usize,
    /// Points in range without a time.
    pub no_time: usize,
}

/// Transforms the points of `view` to the map: point `i` by `map_from_sensor(times[i])`, or all by
/// `map_from_sensor(stamp_ns)` if `times` is `None`.
///
/// Points without a time are dropped and counted if there are times. The order and the bits of the result do not
/// depend on the number of rayon threads. Poses of repeated times are looked up once. Fails with the error of the
/// first kept point whose pose is missing.
pub fn transform_records<E: Send>(
    view: &CloudView<'_>,
    stamp_ns: i64,
    times: Option<&[i64]>,
    range: &RangeLimits,
    format: &RecordFormat,
    map_from_sensor: impl Fn(i64) -> Result<Isometry3<f64>, E> + Sync,
) -> Result<Records, E> {
    let time_of = |i| match times {
        Some(times) => times.get(i).copied().filter(|at| *at != NO_TIME_NS),
        None => Some(stamp_ns),
    };
    let source = Source {
        view,
        range,
        copies: Copies::new(view, &format.copied),
        with_viewpoints: format.with_viewpoints,
        lookup: |i| time_of(i).map(&map_from_sensor).transpose(),
    };
    let shared = times.is_none().then(|| map_from_sensor(stamp_ns).ok());
    if let Some(shared) = shared.filter(|_| !view.is_empty()) {
        return source.records(format, |_| shared.as_ref());
    }
    match times.and_then(|times| Memo::new(times, &map_from_sensor)) {
        Some(memo) => source.records(format, |i| memo.pose(i)),
        None => source.records(format, |_| None),
    }
}

/// Cloud to be transformed. `lookup` returns the pose of a point, `None` without a time.
struct Source<'a, L> {
    view: &'a CloudView<'a>,
    range: &'a RangeLimits,
    copies: Copies,
    with_viewpoints: bool,
    lookup: L,
}

/// Numbers of the points of a part by outcome.
#[derive(Default)]
struct Counts {
    kept: usize,
    not_finite: usize,
    out_of_range: usize,
    no_time: usize,
    /// True if a point requires double precision.
    is_far: bool,
}

impl<'a, E: Send, L> Source<'a, L>
where
    L: Fn(usize) -> Result<Option<Isometry3<f64>>, E> + Sync,
{
    /// Transforms the points; `known` returns poses looked up before.
    fn records<'p>(
        &self,
        format: &RecordFormat,
        known: impl Fn(usize) -> Option<&'p Isometry3<f64>> + Sync,
    ) -> Result<Records, E> {
        let write = |precision: Precision| {
            let (_, bytes) = format.fields(precision);
            match precision {
                Precision::Float32 => self.write::<false>(bytes, &known),
                Precision::Float64 => self.write::<true>(bytes, &known),
            }
        };
        if let Some(precision) = format.precision {
            return write(precision).map(|(records, _)| records);
        }
        // The position of the sensor nearly always predicts whether some point requires double precision.
        let pose = known(0)
            .copied()
            .or_else(|| (self.lookup)(0).ok().flatten());
        let first = pose.map(|pose| Precision::for_point(&pose.translation.vector));
        let first = first.unwrap_or(Precision::Float32);
        let (records, needed) = write(first)?;
        if needed == first {
            return Ok(records);
        }
        write(needed).map(|(records, _)| records)
    }

    /// Records of `bytes` bytes each, and the precision that their points require.
    fn write<'p, const IS_WIDE: bool>(
        &self,
        bytes: usize,
        known: &(impl Fn(usize) -> Option<&'p Isometry3<f64>> + Sync),
    ) -> Result<(Records, Precision), E> {
        let points = self.view.len();
        let threads = rayon::current_num_threads();
        let tasks = if threads == 1 {
            1
        } else {
            threads * CHUNKS_PER_THREAD
        };
        let chunk = points.div_ceil(tasks).max(MIN_CHUNK);
        let mut data = vec![0; points.saturating_mul(bytes)];
        // All results are collected first, so that the first error in order is returned.
        let parts: Vec<Result<Counts, E>> = data
            .par_chunks_mut(chunk.saturating_mul(bytes))
            .enumerate()
            .map(|(part, out)| self.write_part::<IS_WIDE>(part * chunk, bytes, out, known))
            .collect();
        let mut all = Counts::default();
        for (part, counts) in parts.into_iter().enumerate() {
            let counts = counts?;
            // Records are compacted.
            let first = part * chunk;
            if all.kept < first {
                let from = first * bytes;
                data.copy_within(from..from + counts.kept * bytes, all.kept * bytes);
            }
            all.kept += counts.kept;
            all.not_finite += counts.not_finite;
            all.out_of_range += counts.out_of_range;
            all.no_time += counts.no_time;
            all.is_far |= counts.is_far;
        }
        data.truncate(all.kept * bytes);
        let records = Records {
            data,
            points: all.kept,
            precision: Precision::of(IS_WIDE),
            not_finite: all.not_finite,
            out_of_range: all.out_of_range,
            no_time: all.no_time,
        };
        Ok((records, Precision::of(all.is_far)))
    }

    /// Writes the records of the points from `first` on to `out`, which has space for all.
    fn write_part<'p, const IS_WIDE: bool>(
        &self,
        first: usize,
        bytes: usize,
        out: &mut [u8],
        known: &impl Fn(usize) -> Option<&'p Isometry3<f64>>,
    ) -> Result<Counts, E> {
        let range = self.range;
        let indices = first..first + out.len() / bytes;
        let mut counts = Counts::default();
        let mut places = out.chunks_exact_mut(bytes);
        for i in indices {
            let record = self.view.record(i);
            let p = self.view.xyz_of(record);
            let distance_m = p.norm();
            if !distance_m.is_finite() {
                counts.not_finite += 1;
                continue;
            }
            if !(distance_m > range.min_range_m && distance_m <= range.max_range_m) {
                counts.out_of_range += 1;
                continue;
            }
            let looked_up;
            let pose = match known(i) {
                Some(pose) => pose,
                None => {
                    let Some(pose) = (self.lookup)(i)? else {
                        counts.no_time += 1;
                        continue;
                    };
                    looked_up = pose;
                    &looked_up
                }
            };
            let moved = (pose * Point3::from(p)).coords;
            counts.is_far |= Precision::for_point(&moved) == Precision::Float64;
            let Some(place) = places.next() else {
                break;
            };
            let further = write_vector::<IS_WIDE>(&moved, place);
            let further = self.copies.write(record, further);
            if self.with_viewpoints {
                write_vector::<IS_WIDE>(&pose.translation.vector, further);
            }
            counts.kept += 1;
        }
        Ok(counts)
    }
}

/// Poses of repeated times: per column, or per row if the times repeat in every row.
struct Memo {
    /// Index of the pose of each point.
    slots: Vec<u32>,
    /// Poses found; failed lookups are repeated for their errors.
    poses: Vec<Option<Isometry3<f64>>>,
}

impl Memo {
    /// Creates the table; `None` if times rarely repeat.
    fn new<E: Send>(
        times: &[i64],
        map_from_sensor: &(impl Fn(i64) -> Result<Isometry3<f64>, E> + Sync),
    ) -> Option<Memo> {
        let mut distinct_ns: Vec<i64> = Vec::new();
        let mut slots = Vec::with_capacity(times.len());
        // Direct mapped: colliding times displace each other and are looked up again, so that no input degrades the
        // time.
        let mut seen = vec![(NO_TIME_NS, 0_u32); 1 << MEMO_BITS];
        for &at_ns in times {
            if at_ns == NO_TIME_NS {
                slots.push(NO_SLOT);
                continue;
            }
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

    #[inline]
    fn pose(&self, i: usize) -> Option<&Isometry3<f64>> {
        self.poses.get(*self.slots.get(i)? as usize)?.as_ref()
    }
}
