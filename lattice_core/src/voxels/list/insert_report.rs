//! Counts of an insertion.

use crate::lattice::{BatchQuantizer, BatchSums, BlockKey, Coordinate};

/// Points of a cloud by outcome; the outcomes sum to `points`.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct InsertReport {
    /// Number of points in the cloud.
    pub points: u64,
    /// Points inserted.
    pub inserted: u64,
    /// Points with a coordinate that is NaN or infinite.
    pub not_finite: u64,
    /// Points more than 2^20 cells from the datum.
    pub out_of_range: u64,
    /// Points refused because their cell was new and the list full.
    pub list_full: u64,
    /// New voxels.
    pub new_voxels: u64,
    /// Voxels evicted, see [`crate::voxels::WhenFull`].
    pub forgotten_voxels: u64,
}

impl InsertReport {
    /// Counts the points of a batch without a cell, by reason.
    #[inline]
    pub(crate) fn count_rejects<T: Coordinate>(
        &mut self,
        quantizer: &BatchQuantizer,
        points: &[[T; 3]],
        codes: &[BlockKey],
        sums: &BatchSums,
    ) {
        if sums.points < codes.len() as u64 {
            self.count_each_reject(quantizer, points, codes);
        }
    }

    #[cold]
    fn count_each_reject<T: Coordinate>(
        &mut self,
        quantizer: &BatchQuantizer,
        points: &[[T; 3]],
        codes: &[BlockKey],
    ) {
        for (point, code) in points.iter().zip(codes) {
            if *code == BlockKey::NONE {
                let finite = quantizer.transform(*point).iter().all(|x| x.is_finite());
                *(if finite {
                    &mut self.out_of_range
                } else {
                    &mut self.not_finite
                }) += 1;
            }
        }
    }

    /// Adds the outcomes of other points.
    pub(crate) fn add(&mut self, other: &InsertReport) {
        self.points += other.points;
        self.inserted += other.inserted;
        self.not_finite += other.not_finite;
        self.out_of_range += other.out_of_range;
        self.list_full += other.list_full;
        self.new_voxels += other.new_voxels;
        self.forgotten_voxels += other.forgotten_voxels;
    }
}
