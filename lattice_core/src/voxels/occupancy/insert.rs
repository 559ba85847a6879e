//! Inserting clouds into an occupancy list.

use rayon::prelude::*;

use super::recent_cells::Recent;
use super::{Last, OccupancyList};
use crate::cloud::Cloud;
use crate::lattice::{BatchQuantizer, BlockKey};
use crate::voxels::InsertReport;

/// Minimum number of points per thread.
const PART: usize = 1 << 13;
/// Points between two merges into the list; bounds the memory of unmerged points.
const WAVE: usize = 1 << 18;

impl OccupancyList {
    pub(super) fn insert_cloud(&mut self, cloud: &Cloud) -> InsertReport {
        let points = &cloud.offsets_m[..];
        let mut report = InsertReport {
            points: points.len() as u64,
            ..InsertReport::default()
        };
        let before = self.len;
        let quantizer = self.quantizer(cloud);
        let waves: Vec<_> = points.chunks(WAVE).collect();
        let may_fill = self.blocks.len().saturating_add(points.len()) > self.max_blocks;
        if rayon::current_num_threads() == 1 || points.len() < 2 * PART || may_fill {
            self.insert_serially(&quantizer, points, &mut report);
        } else {
            self.insert_waves(&quantizer, &waves, &mut report);
        }
        report.inserted =
            report.points - report.not_finite - report.out_of_range - report.list_full;
        report.new_voxels = (self.len - before) as u64;
        report
    }

    fn quantizer(&self, cloud: &Cloud) -> BatchQuantizer {
        let shift = nalgebra::Translation3::from(cloud.datum_m - self.datum_m);
        BatchQuantizer::new(&self.lattice, shift.into())
    }

    fn insert_serially(
        &mut self,
        quantizer: &BatchQuantizer,
        points: &[[f32; 3]],
        report: &mut InsertReport,
    ) {
        let mut recent = std::mem::take(&mut self.recent);
        let mut last = Last::default();
        let mut place = 0;
        quantizer.for_blocks(points, |codes, sums| {
            let here = points.get(place..).unwrap_or_default();
            place += codes.len();
            report.count_rejects(quantizer, here, codes, sums);
            let mut fresh = [BlockKey::NONE; BatchQuantizer::BLOCK];
            let count = recent.sift(codes, &mut fresh);
            let mut refused = false;
            for &code in fresh.iter().take(count) {
                if code != BlockKey::NONE && !self.set(code, &mut last) {
                    recent.forget(code);
                    refused = true;
                }
            }
            if refused {
                let outside = |code: &&BlockKey| **code != BlockKey::NONE && !self.has(**code);
                report.list_full += codes.iter().filter(outside).count() as u64;
            }
        });
        self.recent = recent;
    }

    /// Inserts in waves on the threads of the current pool: while the cells of one are set, the next is quantized.
    /// Requires free space for one block per point.
    fn insert_waves(
        &mut self,
        quantizer: &BatchQuantizer,
        waves: &[&[[f32; 3]]],
        report: &mut InsertReport,
    ) {
        let parts = 2 * rayon::current_num_threads();
        let mut filled: Vec<Sifter> = Vec::new();
        let mut next: Vec<Sifter> = (0..parts).map(|_| Sifter::new()).collect();
        for wave in waves.iter().map(Some).chain([None]) {
            let sift = || {
                let wave = wave.copied().unwrap_or_default();
                let points = wave.par_chunks(wave.len().div_ceil(parts).max(PART));
                points
                    .zip(next.par_iter_mut())
                    .for_each(|(points, sifter)| sifter.sift(quantizer, points));
            };
            rayon::join(|| self.set_all(&mut filled, report), sift);
            filled.resize_with(parts, Sifter::new);
            std::mem::swap(&mut filled, &mut next);
        }
    }

    fn set_all(&mut self, sifted: &mut [Sifter], report: &mut InsertReport) {
        let mut last = Last::default();
        for sifter in sifted {
            report.add(&std::mem::take(&mut sifter.rejects));
            for code in sifter.kept.drain(..) {
                if code != BlockKey::NONE {
                    self.set(code, &mut last);
                }
            }
        }
    }
}

/// Quantizes points and drops recently seen cells.
struct Sifter {
    recent: Recent,
    kept: Vec<BlockKey>,
    rejects: InsertReport,
}

impl Sifter {
    fn new() -> Sifter {
        Sifter {
            recent: Recent::new(),
            kept: Vec::new(),
            rejects: InsertReport::default(),
        }
    }

    fn sift(&mut self, quantizer: &BatchQuantizer, points: &[[f32; 3]]) {
        let mut place = 0;
        quantizer.for_blocks(points, |codes, sums| {
            let here = points.get(place..).unwrap_or_default();
            place += codes.len();
            self.rejects.count_rejects(quantizer, here, codes, sums);
            let mut fresh = [BlockKey::NONE; BatchQuantizer::BLOCK];
            let count = self.recent.sift(codes, &mut fresh);
            self.kept
                .extend_from_slice(fresh.get(..count).unwrap_or_default());
        });
    }
}
