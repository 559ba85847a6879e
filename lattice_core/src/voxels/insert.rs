//! Inserting clouds.

use nalgebra::Translation3;
use rayon::prelude::*;

use super::VoxelList;
use super::columns::{Details, LabelCount, Stamps};
use super::distortion::DistortionSums;
use super::fixed::{fixed_points, moment_unit_m, moments_of, voxel_of};
use super::shard::{Point, SHARDS, Shard, shard_of};
use crate::cloud::Cloud;
use crate::lattice::{BatchQuantizer, BatchSums, CellCode, Lattice};

/// Points that one task quantizes.
const CHUNK: usize = 4096;
/// Points between two merges; bounds the memory for what is not yet merged.
const WAVE: usize = 16 * CHUNK;

/// What became of the points of a cloud; the reasons add up to `points`.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct InsertReport {
    /// Points in the cloud.
    pub points: u64,
    /// Points now in the list.
    pub inserted: u64,
    /// Points with a coordinate that is NaN or infinite.
    pub not_finite: u64,
    /// Points more than 2^20 cells from the datum.
    pub out_of_range: u64,
    /// Points whose cell would have been new when the list was full.
    pub list_full: u64,
    /// Voxels that were not in the list before.
    pub new_voxels: u64,
}

impl InsertReport {
    /// Counts the points of a batch that have no cell, by reason.
    #[inline]
    pub(super) fn count_rejects(
        &mut self,
        quantizer: &BatchQuantizer,
        points: &[[f32; 3]],
        codes: &[CellCode],
        sums: &BatchSums,
    ) {
        if sums.points < codes.len() as u64 {
            self.count_each_reject(quantizer, points, codes);
        }
    }

    #[cold]
    fn count_each_reject(
        &mut self,
        quantizer: &BatchQuantizer,
        points: &[[f32; 3]],
        codes: &[CellCode],
    ) {
        for (point, code) in points.iter().zip(codes) {
            if *code == CellCode::NONE {
                let finite = quantizer.transform(*point).iter().all(|x| x.is_finite());
                *(if finite {
                    &mut self.out_of_range
                } else {
                    &mut self.not_finite
                }) += 1;
            }
        }
    }

    /// Adds what became of other points.
    pub(super) fn add(&mut self, other: &InsertReport) {
        self.points += other.points;
        self.inserted += other.inserted;
        self.not_finite += other.not_finite;
        self.out_of_range += other.out_of_range;
        self.list_full += other.list_full;
        self.new_voxels += other.new_voxels;
    }
}

/// Labels of the points of a cloud, one each, and its stamp.
#[derive(Clone, Copy)]
struct Origin<'a> {
    stamp_ns: i64,
    labels: Option<&'a [u16]>,
}

/// The points of a chunk, quantized and in the order of their shards.
struct Chunk {
    codes: Vec<CellCode>,
    points: Vec<Point>,
    /// Numbers of the points with a cell, shard after shard.
    order: Vec<u16>,
    /// Where in `order` the shards end.
    ends: [usize; SHARDS],
    report: InsertReport,
    sums: DistortionSums,
}

impl VoxelList {
    /// Adds every finite point in range to its cell, on the threads of the current rayon pool.
    ///
    /// When the list is full, points in known cells still count; which cells are new is decided in
    /// the order of the points. The outcome does not depend on the number of threads.
    pub fn insert(&mut self, cloud: &Cloud) -> InsertReport {
        self.insert_labelled(cloud, &[])
    }

    /// [`VoxelList::insert`] with a label for each point; points beyond the labels have none.
    pub fn insert_labelled(&mut self, cloud: &Cloud, labels: &[u16]) -> InsertReport {
        let before = self.len();
        let mut report = InsertReport {
            points: cloud.offsets_m.len() as u64,
            ..InsertReport::default()
        };
        let now = self.advance();
        let shift = Translation3::from(cloud.datum_m - self.datum_m);
        let quantizer = BatchQuantizer::new(&self.lattice, shift.into());
        let threads = rayon::current_num_threads();
        let mut chunks: Vec<Chunk> = Vec::new();
        let mut labels = labels;
        for wave in cloud.offsets_m.chunks(WAVE) {
            let origin = Origin {
                stamp_ns: cloud.stamp_ns,
                labels: (!labels.is_empty()).then_some(labels),
            };
            labels = labels.get(wave.len()..).unwrap_or_default();
            let may_fill = self.len().saturating_add(wave.len()) > self.max_voxels;
            let alone = threads == 1 || wave.len() <= CHUNK || may_fill;
            if alone || !self.payload.is_plain() {
                self.insert_serially(&quantizer, wave, origin, now, &mut report);
            } else {
                chunks.resize_with(wave.len().div_ceil(CHUNK), Chunk::new);
                self.insert_wave(&quantizer, wave, now, &mut chunks, &mut report);
            }
        }
        report.inserted =
            report.points - report.not_finite - report.out_of_range - report.list_full;
        report.new_voxels = (self.len() - before) as u64;
        report
    }

    fn insert_serially(
        &mut self,
        quantizer: &BatchQuantizer,
        offsets_m: &[[f32; 3]],
        origin: Origin,
        now: u32,
        report: &mut InsertReport,
    ) {
        let base_m = quantizer.translation_m();
        let mut room = self.max_voxels.saturating_sub(self.len());
        let mut points = [[0; 4]; BatchQuantizer::BLOCK];
        let mut place = 0;
        quantizer.for_blocks_with_sums(offsets_m, |codes, sums| {
            let here = offsets_m.get(place..).unwrap_or_default();
            report.count_rejects(quantizer, here, codes, sums);
            fixed_points(base_m, here, &mut points);
            // All searches begin before the first of them is followed: their waits for memory
            // overlap.
            let mut peeked = [0; BatchQuantizer::BLOCK];
            for (peeked, &code) in peeked.iter_mut().zip(codes) {
                *peeked = self
                    .shards
                    .get(shard_of(code))
                    .map_or(0, |shard| shard.voxels.peek(code.raw()));
            }
            let mut refused = false;
            for (i, ((&code, point), &peeked)) in codes.iter().zip(&points).zip(&peeked).enumerate()
            {
                let Some(shard) = self.shards.get_mut(shard_of(code)) else {
                    continue;
                };
                if let Some(number) = shard.voxels.find_in(peeked, code.raw()) {
                    shard.add(number, point, now);
                    if !self.payload.is_plain() {
                        let details = details(&self.lattice, code, point, origin, place + i);
                        shard.columns.add(number as usize, &details);
                    }
                    continue;
                }
                if code == CellCode::NONE {
                    continue;
                }
                let known = shard.len();
                let limit = known.saturating_add(room);
                let Some(number) = shard.find_or_add(code.raw(), limit, now) else {
                    report.list_full += 1;
                    refused = true;
                    continue;
                };
                room -= shard.len() - known;
                shard.add(number, point, now);
                if !self.payload.is_plain() {
                    let details = details(&self.lattice, code, point, origin, place + i);
                    shard.columns.add(number as usize, &details);
                }
            }
            place += codes.len();
            if refused {
                self.add_sums_of_known(quantizer, here, codes);
            } else {
                self.sums.add_batch(sums);
            }
        });
    }

    /// Adds the quantization errors of a block of which some points were refused.
    #[cold]
    fn add_sums_of_known(
        &mut self,
        quantizer: &BatchQuantizer,
        offsets_m: &[[f32; 3]],
        codes: &[CellCode],
    ) {
        for (&offset, &code) in offsets_m.iter().zip(codes) {
            let known = |shard: &Shard| shard.get(code).is_some();
            if code != CellCode::NONE && self.shard(code).is_some_and(known) {
                self.sums.add_batch(&quantizer.sums_of(offset));
            }
        }
    }

    fn insert_wave(
        &mut self,
        quantizer: &BatchQuantizer,
        wave: &[[f32; 3]],
        now: u32,
        chunks: &mut [Chunk],
        report: &mut InsertReport,
    ) {
        let parts = wave.par_chunks(CHUNK).zip(chunks.par_iter_mut());
        parts.for_each(|(offsets_m, chunk)| chunk.fill(quantizer, offsets_m));
        let shards = self.shards.par_iter_mut().enumerate();
        shards.for_each(|(part, shard)| {
            for chunk in chunks.iter() {
                chunk.for_shard(part, |code, point| {
                    if let Some(number) = shard.find_or_add(code.raw(), usize::MAX, now) {
                        shard.add(number, point, now);
                    }
                });
            }
        });
        for chunk in chunks {
            report.add(&chunk.report);
            self.sums.add(&chunk.sums);
        }
    }
}

/// What a point adds to the further columns.
fn details(
    lattice: &Lattice,
    code: CellCode,
    point: &Point,
    origin: Origin,
    place: usize,
) -> Details {
    let label = origin.labels.and_then(|labels| labels.get(place).copied());
    let offset = voxel_of(lattice, code, point).sum;
    Details {
        moments: moments_of(offset, moment_unit_m(lattice)),
        stamps: Some(Stamps {
            first_ns: origin.stamp_ns,
            last_ns: origin.stamp_ns,
        }),
        labels: label
            .map(|label| LabelCount { label, count: 1 })
            .into_iter()
            .collect(),
    }
}

impl Chunk {
    fn new() -> Chunk {
        Chunk {
            codes: Vec::with_capacity(CHUNK),
            points: Vec::with_capacity(CHUNK),
            order: Vec::with_capacity(CHUNK),
            ends: [0; SHARDS],
            report: InsertReport::default(),
            sums: DistortionSums::default(),
        }
    }

    /// Quantizes at most `CHUNK` points.
    fn fill(&mut self, quantizer: &BatchQuantizer, offsets_m: &[[f32; 3]]) {
        self.codes.clear();
        self.points.clear();
        (self.report, self.sums) = Default::default();
        let base_m = quantizer.translation_m();
        let mut points = [[0; 4]; BatchQuantizer::BLOCK];
        quantizer.for_blocks_with_sums(offsets_m, |codes, sums| {
            let here = offsets_m.get(self.codes.len()..).unwrap_or_default();
            self.report.count_rejects(quantizer, here, codes, sums);
            self.sums.add_batch(sums);
            fixed_points(base_m, here, &mut points);
            self.codes.extend_from_slice(codes);
            self.points.extend(points.iter().take(codes.len()));
        });
        self.sort();
    }

    /// Counting sort of the points by shard.
    fn sort(&mut self) {
        let with_cell = || self.codes.iter().filter(|code| **code != CellCode::NONE);
        let mut nexts = [0; SHARDS];
        for &code in with_cell() {
            nexts[shard_of(code)] += 1;
        }
        let mut total = 0;
        for (next, end) in nexts.iter_mut().zip(&mut self.ends) {
            let begin = total;
            total += *next;
            (*next, *end) = (begin, total);
        }
        self.order.clear();
        self.order.resize(total, 0);
        for (number, &code) in (0_u16..).zip(&self.codes) {
            if code == CellCode::NONE {
                continue;
            }
            let next = &mut nexts[shard_of(code)];
            if let Some(place) = self.order.get_mut(*next) {
                *place = number;
            }
            *next += 1;
        }
    }

    /// Visits the points of a shard.
    #[inline]
    fn for_shard(&self, shard: usize, mut visit: impl FnMut(CellCode, &Point)) {
        let begin = shard.checked_sub(1).map_or(0, |before| self.ends[before]);
        let numbers = self.order.get(begin..self.ends[shard]);
        for &number in numbers.unwrap_or_default() {
            let number = usize::from(number);
            if let (Some(&code), Some(point)) = (self.codes.get(number), self.points.get(number)) {
                visit(code, point);
            }
        }
    }
}
