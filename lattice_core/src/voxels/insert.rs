//! Inserting clouds.

use nalgebra::Vector3;
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::distortion::DistortionSums;
use super::{OFFSET_UNIT_M, Voxel, VoxelList};
use crate::cloud::Cloud;
use crate::lattice::{BatchQuantizer, BatchSums, CellCode, Key, Lattice, nearest_integer};

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

/// The points of one chunk in one cell.
struct Tally {
    key: Key,
    voxel: Voxel,
    sums: DistortionSums,
}

/// Where in `Partial::tallies` the cells are.
type Places = FxHashMap<Key, usize>;

/// The cells of one chunk in the order of their first points.
#[derive(Default)]
struct Partial {
    tallies: Vec<Tally>,
    not_finite: u64,
    out_of_range: u64,
}

impl VoxelList {
    /// Adds every finite point in range to its cell, on the threads of the current rayon pool.
    ///
    /// When the list is full, points in known cells still count; which cells are new is decided in
    /// the order of the points. The outcome does not depend on the number of threads.
    pub fn insert(&mut self, cloud: &Cloud) -> InsertReport {
        let before = self.len() as u64;
        let mut report = InsertReport {
            points: cloud.offsets_m.len() as u64,
            ..InsertReport::default()
        };
        let base_m = cloud.datum_m - self.datum_m;
        for wave in cloud.offsets_m.chunks(WAVE) {
            let lattice = &self.lattice;
            let quantize = |places: &mut Places, chunk| tally(lattice, base_m, chunk, places);
            let partials: Vec<Partial> = if wave.len() <= CHUNK {
                vec![quantize(&mut Places::default(), wave)]
            } else {
                let chunks = wave.par_chunks(CHUNK);
                chunks.map_init(Places::default, quantize).collect()
            };
            partials
                .iter()
                .for_each(|partial| self.add_partial(partial, &mut report));
        }
        report.new_voxels = self.len() as u64 - before;
        report
    }

    fn add_partial(&mut self, partial: &Partial, report: &mut InsertReport) {
        report.not_finite += partial.not_finite;
        report.out_of_range += partial.out_of_range;
        for tally in &partial.tallies {
            if self.add(tally.key, &tally.voxel) {
                self.sums.add(&tally.sums);
                report.inserted += tally.sums.points;
            } else {
                report.list_full += tally.sums.points;
            }
        }
    }
}

/// Quantizes points at `base_m + offset` from the datum and gathers them by cell.
fn tally(
    lattice: &Lattice,
    base_m: Vector3<f64>,
    offsets_m: &[[f32; 3]],
    places: &mut Places,
) -> Partial {
    let mut partial = Partial::default();
    places.clear();
    let [bx, by, bz] = base_m.into();
    let points = offsets_m
        .iter()
        .map(|&[x, y, z]| [bx + f64::from(x), by + f64::from(y), bz + f64::from(z)]);
    // Points of a scan often share the cell of the point before.
    let mut last: Option<(Key, usize)> = None;
    lattice.quantize_each(points, |p, w| {
        let Some((w, key)) = w.and_then(|w| Key::pack(w).map(|key| (w, key))) else {
            let finite = p.iter().all(|x| x.is_finite());
            *(if finite {
                &mut partial.out_of_range
            } else {
                &mut partial.not_finite
            }) += 1;
            return;
        };
        let place = match last {
            Some((same, place)) if same == key => place,
            _ => *places.entry(key).or_insert(partial.tallies.len()),
        };
        last = Some((key, place));
        if place == partial.tallies.len() {
            let (voxel, sums) = (Voxel::default(), DistortionSums::default());
            partial.tallies.push(Tally { key, voxel, sums });
        }
        let from_center = Vector3::from(p) - lattice.center(w);
        let offset = [from_center.x, from_center.y, from_center.z]
            .map(|metres| nearest_integer(metres / OFFSET_UNIT_M));
        if let Some(tally) = partial.tallies.get_mut(place) {
            tally.voxel.add(&Voxel {
                count: 1,
                sum: offset,
            });
            tally.sums.add_point(offset);
        }
    });
    partial
}
