//! Inserting clouds into a list, on one or many threads.

use nalgebra::{Translation3, Vector3};
use rayon::prelude::*;

use super::VoxelList;
pub use super::insert_report::InsertReport;
use crate::cloud::Cloud;
use crate::lattice::{BatchBlock, BatchQuantizer, BlockKey, Coordinate};
use crate::voxels::distortion::DistortionSums;
use crate::voxels::store::color_sum::ColorSum;
use crate::voxels::store::fixed_point::{FixedBlock, most_points, near_point};
use crate::voxels::store::payload_columns::{Details, LabelCount, Stamps};
use crate::voxels::store::point_gather::{Gather, Partial};
use crate::voxels::store::shard::{BATCH, SHARDS, Shard, shard_of};

/// Minimum number of points for gathering.
const FEW: usize = 1 << 12;
/// Minimum number of points per thread.
const PART: usize = 1 << 13;
/// Points between two merges; bounds the memory of unmerged points.
const WAVE: usize = 1 << 18;

/// Stamps, labels and colours of points.
#[derive(Clone, Copy, Debug, Default)]
pub struct PointColumns<'a> {
    /// Stamp of points without one of their own, ns.
    pub stamp_ns: i64,
    /// Stamps of the first points, ns.
    pub stamps_ns: &'a [i64],
    /// Labels of the first points; others have none.
    pub labels: &'a [u16],
    /// Red, green and blue of the first points; others have no colour.
    pub colors: &'a [Option<[u8; 3]>],
}

impl PointColumns<'_> {
    /// Columns of the points from `place` on.
    fn after(self, place: usize) -> Self {
        PointColumns {
            stamps_ns: self.stamps_ns.get(place..).unwrap_or_default(),
            labels: self.labels.get(place..).unwrap_or_default(),
            colors: self.colors.get(place..).unwrap_or_default(),
            ..self
        }
    }

    /// Contribution of a point to the optional columns.
    fn details(&self, place: usize) -> Details {
        let stamp_ns = self.stamps_ns.get(place).copied().unwrap_or(self.stamp_ns);
        let label = self.labels.get(place).copied();
        let color = self.colors.get(place).copied().flatten();
        Details {
            stamps: Some(Stamps {
                first_ns: stamp_ns,
                last_ns: stamp_ns,
            }),
            labels: label
                .map(|label| LabelCount { label, count: 1 })
                .into_iter()
                .collect(),
            color: color.map(ColorSum::of_point).unwrap_or_default(),
        }
    }
}

/// Points of a chunk, quantized and gathered by cell, the cells by shard.
struct Chunk {
    gather: Gather,
    by_shard: Vec<Vec<Partial>>,
    report: InsertReport,
    sums: DistortionSums,
}

impl VoxelList {
    /// Adds every finite point in range to its cell, on the threads of the current rayon pool.
    ///
    /// In a full list, points in existing cells still count; new cells are decided in the order of the points. The
    /// result does not depend on the number of threads.
    pub fn insert(&mut self, cloud: &Cloud) -> InsertReport {
        self.insert_labelled(cloud, &[])
    }

    /// [`VoxelList::insert`] with a label per point; points beyond the labels have none.
    pub fn insert_labelled(&mut self, cloud: &Cloud, labels: &[u16]) -> InsertReport {
        self.insert_offsets(cloud.stamp_ns, cloud.datum_m, &cloud.offsets_m, labels)
    }

    /// [`VoxelList::insert_labelled`] for the parts of a borrowed [`Cloud`].
    pub fn insert_offsets(
        &mut self,
        stamp_ns: i64,
        datum_m: Vector3<f64>,
        offsets_m: &[[f32; 3]],
        labels: &[u16],
    ) -> InsertReport {
        let columns = PointColumns {
            stamp_ns,
            labels,
            ..PointColumns::default()
        };
        self.insert_points(datum_m, offsets_m, columns)
    }

    /// Adds points `datum_m + offset`, as [`VoxelList::insert`], in the precision of their coordinates.
    pub fn insert_points<T: Coordinate>(
        &mut self,
        datum_m: Vector3<f64>,
        offsets_m: &[[T; 3]],
        columns: PointColumns,
    ) -> InsertReport {
        let before = self.len();
        let mut report = InsertReport {
            points: offsets_m.len() as u64,
            ..InsertReport::default()
        };
        let now = self.advance();
        let shift = Translation3::from(datum_m - self.datum_m);
        let quantizer = BatchQuantizer::new(&self.lattice, shift.into());
        let mut chunks: Vec<Chunk> = Vec::new();
        let mut columns = columns;
        for wave in offsets_m.chunks(self.wave_points(WAVE)) {
            report.forgotten_voxels += self.make_room(wave.len(), now) as u64;
            let of_wave = columns;
            columns = columns.after(wave.len());
            let may_fill = self.len().saturating_add(wave.len()) > self.max_voxels;
            if may_fill || !self.payload.is_plain() || wave.len() < FEW {
                self.insert_singly(&quantizer, wave, of_wave, now, &mut report);
                continue;
            }
            // One part per thread; the partition does not affect the sums.
            let parts = (wave.len() / PART).clamp(1, rayon::current_num_threads());
            chunks.resize_with(parts.max(chunks.len()), Chunk::new);
            let parts = chunks.get_mut(..parts).unwrap_or_default();
            self.insert_wave(&quantizer, wave, now, parts);
            for chunk in &mut chunks {
                report.add(&std::mem::take(&mut chunk.report));
                self.sums.add(&std::mem::take(&mut chunk.sums));
            }
        }
        report.inserted =
            report.points - report.not_finite - report.out_of_range - report.list_full;
        report.new_voxels = self.len() as u64 + report.forgotten_voxels - before as u64;
        report
    }

    /// Inserts point by point, with the outcome of each.
    fn insert_singly<T: Coordinate>(
        &mut self,
        quantizer: &BatchQuantizer,
        offsets_m: &[[T; 3]],
        columns: PointColumns,
        now: u32,
        report: &mut InsertReport,
    ) {
        let mut room = self.max_voxels.saturating_sub(self.len());
        let mut place = 0;
        for_fixed_blocks(quantizer, offsets_m, |offsets_m, block, points| {
            let (codes, sums) = (block.codes, block.sums);
            report.count_rejects(quantizer, offsets_m, codes, sums);
            let mut refused = false;
            for (i, &code) in codes.iter().enumerate() {
                let shard = self.shards.get_mut(shard_of(code));
                let Some(shard) = shard.filter(|_| code != BlockKey::NONE) else {
                    continue;
                };
                let known = shard.len();
                let limit = known.saturating_add(room);
                let Some(number) = shard.find_or_add(code, limit, now) else {
                    report.list_full += 1;
                    refused = true;
                    continue;
                };
                room -= shard.len() - known;
                shard.add(number, &points.point(i), now);
                if !self.payload.is_plain() {
                    let details = columns.details(place + i);
                    shard.columns.add(number as usize, &details);
                }
            }
            place += codes.len();
            if refused {
                self.add_sums_of_known(quantizer, offsets_m, codes);
            } else {
                self.sums.add_batch(sums);
            }
        });
    }

    /// Adds the quantization errors of a block with refused points.
    #[cold]
    fn add_sums_of_known<T: Coordinate>(
        &mut self,
        quantizer: &BatchQuantizer,
        offsets_m: &[[T; 3]],
        codes: &[BlockKey],
    ) {
        for (&offset, &code) in offsets_m.iter().zip(codes) {
            let known = |shard: &Shard| shard.get(code).is_some();
            if code != BlockKey::NONE && self.shard(code).is_some_and(known) {
                self.sums.add_batch(&T::sums_of(quantizer, offset));
            }
        }
    }

    /// Inserts on the threads of the current pool: first by parts of the points, then by shards. Requires free space
    /// for one voxel per point.
    fn insert_wave<T: Coordinate>(
        &mut self,
        quantizer: &BatchQuantizer,
        wave: &[[T; 3]],
        now: u32,
        chunks: &mut [Chunk],
    ) {
        let parts = wave.par_chunks(wave.len().div_ceil(chunks.len().max(1)).max(1));
        let parts = parts.zip(chunks.par_iter_mut());
        let most_points = most_points(&self.lattice);
        parts.for_each(|(offsets_m, chunk)| chunk.sort(quantizer, offsets_m, most_points));
        let shards = self.shards.par_iter_mut().enumerate();
        shards.for_each(|(part, shard)| {
            let lists = chunks.iter().filter_map(|chunk| chunk.by_shard.get(part));
            for batch in lists.flat_map(|list| list.chunks(BATCH)) {
                shard.add_batch(batch, now);
            }
        });
    }
}

/// Visits up to a block of points at a time: offsets, cells and errors, fixed-point positions.
#[inline(always)]
fn for_fixed_blocks<T: Coordinate>(
    quantizer: &BatchQuantizer,
    offsets_m: &[[T; 3]],
    mut visit: impl FnMut(&[[T; 3]], &BatchBlock, &FixedBlock<T>),
) {
    let base_m = quantizer.translation_m();
    let mut place = 0;
    T::for_blocks_with_sums(quantizer, offsets_m, |block| {
        let end = place + block.codes.len();
        let here = offsets_m.get(place..end).unwrap_or_default();
        place = end;
        visit(here, block, &FixedBlock::new(base_m, here, block));
    });
}

impl Chunk {
    fn new() -> Chunk {
        Chunk {
            gather: Gather::new(),
            by_shard: vec![Vec::new(); SHARDS],
            report: InsertReport::default(),
            sums: DistortionSums::default(),
        }
    }

    /// Gathers points by cell, up to `most_points`, and the cells by shard.
    fn sort<T: Coordinate>(
        &mut self,
        quantizer: &BatchQuantizer,
        offsets_m: &[[T; 3]],
        most_points: u32,
    ) {
        let Chunk {
            gather,
            by_shard,
            report,
            sums,
        } = self;
        by_shard.iter_mut().for_each(Vec::clear);
        let mut take = |partial: Partial| {
            if let Some(list) = by_shard.get_mut(shard_of(partial.code)) {
                list.push(partial);
            }
        };
        for_fixed_blocks(quantizer, offsets_m, |offsets_m, block, points| {
            report.count_rejects(quantizer, offsets_m, block.codes, block.sums);
            sums.add_batch(block.sums);
            let moved = match points.near() {
                Some((near, base)) => {
                    gather.add(block.codes, |i| near_point(near, base, i), most_points)
                }
                None => gather.add(block.codes, |i| points.point(i), most_points),
            };
            let moved = moved.iter().copied();
            moved
                .filter(|partial| partial.code != BlockKey::NONE)
                .for_each(&mut take);
        });
        gather.drain().for_each(take);
    }
}
