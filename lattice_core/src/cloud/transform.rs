//! Deskewing: transforms every point to the map frame with the pose at its own time, from record to record in one
//! pass.

use nalgebra::Isometry3;
use rayon::prelude::*;

use super::block::{Block, LANES, at};
use super::record::{Copies, Precision, RecordFormat, write_vector};
use super::{CloudView, NO_TIME_NS, RangeLimits};

/// Minimum number of points per task.
const MIN_CHUNK: usize = 2048;
/// Tasks per thread, for an even distribution.
const CHUNKS_PER_THREAD: usize = 4;
/// Size of the table of repeated times, as a power of two: far more than the columns of a spinning lidar.
const MEMO_BITS: u32 = 15;
/// Slot of a point without a time.
const NO_SLOT: u32 = u32::MAX;

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
    if let Some(shared) = shared.flatten().filter(|_| !view.is_empty()) {
        return source.records(format, &Known::Shared(shared));
    }
    match times.and_then(|times| Memo::new(times, &map_from_sensor)) {
        Some(memo) => source.records(format, &Known::Repeated(memo)),
        None => source.records(format, &Known::Nothing),
    }
}

/// Poses looked up before.
enum Known {
    /// Pose of all points.
    Shared(Isometry3<f64>),
    /// Poses of repeated times.
    Repeated(Memo),
    Nothing,
}

impl Known {
    #[inline]
    fn pose(&self, i: usize) -> Option<&Isometry3<f64>> {
        match self {
            Known::Shared(pose) => Some(pose),
            Known::Repeated(memo) => memo.pose(i),
            Known::Nothing => None,
        }
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
    /// Transforms the points.
    fn records(&self, format: &RecordFormat, known: &Known) -> Result<Records, E> {
        let write = |precision: Precision| {
            let (_, bytes) = format.fields(precision);
            match precision {
                Precision::Float32 => self.write::<false>(bytes, known),
                Precision::Float64 => self.write::<true>(bytes, known),
            }
        };
        if let Some(precision) = format.precision {
            return write(precision).map(|(records, _)| records);
        }
        // The position of the sensor nearly always predicts whether some point requires double precision.
        let pose = known
            .pose(0)
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
    fn write<const IS_WIDE: bool>(
        &self,
        bytes: usize,
        known: &Known,
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
    fn write_part<const IS_WIDE: bool>(
        &self,
        first: usize,
        bytes: usize,
        out: &mut [u8],
        known: &Known,
    ) -> Result<Counts, E> {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: AVX2 was detected.
            #[allow(unsafe_code)]
            return unsafe { self.write_part_avx2::<IS_WIDE>(first, bytes, out, known) };
        }
        self.write_blocks::<IS_WIDE>(first, bytes, out, known)
    }

    /// [`Self::write_blocks`] with 256-bit vectors: the same operations in the same order, hence the same bits.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn write_part_avx2<const IS_WIDE: bool>(
        &self,
        first: usize,
        bytes: usize,
        out: &mut [u8],
        known: &Known,
    ) -> Result<Counts, E> {
        self.write_blocks::<IS_WIDE>(first, bytes, out, known)
    }

    #[inline(always)]
    fn write_blocks<const IS_WIDE: bool>(
        &self,
        first: usize,
        bytes: usize,
        out: &mut [u8],
        known: &Known,
    ) -> Result<Counts, E> {
        let end = first + out.len() / bytes;
        let mut counts = Counts::default();
        let mut places = out.chunks_exact_mut(bytes);
        let mut block = Block::default();
        if let Known::Shared(pose) = known {
            (0..LANES).for_each(|lane| block.set_pose(lane, pose));
        }
        for start in (first..end).step_by(LANES) {
            let lanes = LANES.min(end - start);
            self.view.read(start, lanes, &mut block.points_m);
            block.measure();
            let (finite, in_range) = block.outcomes(lanes, self.range);
            counts.not_finite += lanes - finite.count_ones() as usize;
            counts.out_of_range += (finite & !in_range).count_ones() as usize;
            let mut kept = finite & in_range;
            if !matches!(known, Known::Shared(_)) {
                for lane in 0..lanes {
                    if kept & (1 << lane) == 0 {
                        continue;
                    }
                    let i = start + lane;
                    if let Some(pose) = known.pose(i) {
                        block.set_pose(lane, pose);
                    } else if let Some(pose) = (self.lookup)(i)? {
                        block.set_pose(lane, &pose);
                    } else {
                        counts.no_time += 1;
                        kept &= !(1 << lane);
                    }
                }
            }
            block.transform();
            for (lane, place) in (0..lanes)
                .filter(|lane| kept & (1 << lane) != 0)
                .zip(&mut places)
            {
                let moved = at(&block.moved_m, lane);
                counts.is_far |= Precision::for_point(&moved) == Precision::Float64;
                let further = write_vector::<IS_WIDE>(&moved, place);
                let further = self.copies.write(self.view, start + lane, further);
                if self.with_viewpoints {
                    write_vector::<IS_WIDE>(&at(&block.translation_m, lane), further);
                }
                counts.kept += 1;
            }
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
