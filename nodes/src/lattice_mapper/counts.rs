//! Counters of a mapper: clouds and points taken, refused, mapped.

use lattice_core::voxels::InsertReport;
use serde::{Deserialize, Serialize};

/// Counters of one mapper; points of a refused cloud are not counted as points.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MapperCounts {
    /// Clouds received.
    pub clouds_in: u64,
    /// Clouds refused: not in the map frame.
    pub clouds_wrong_frame: u64,
    /// Clouds refused: the bytes are not what the header says.
    pub clouds_malformed: u64,
    /// Clouds taken without labels, where those are kept.
    #[serde(default)]
    pub clouds_unlabelled: u64,
    /// Points of the clouds that were taken.
    pub points_in: u64,
    /// Points in the map.
    pub points_mapped: u64,
    /// Points refused: NaN or infinite.
    pub points_not_finite: u64,
    /// Points refused: farther from the datum than voxel keys reach.
    pub points_out_of_range: u64,
    /// Points refused: they need a voxel more than `max_voxels` or `max_map_bytes` allow.
    pub points_list_full: u64,
    /// Voxels that went because the map was full or they were too old.
    #[serde(default)]
    pub voxels_forgotten: u64,
    /// Update steps made.
    pub updates: u64,
    /// Keyframes made.
    pub keyframes: u64,
}

impl MapperCounts {
    /// Adds what one insertion did.
    pub fn add(&mut self, report: &InsertReport) {
        self.points_in += report.points;
        self.points_mapped += report.inserted;
        self.points_not_finite += report.not_finite;
        self.points_out_of_range += report.out_of_range;
        self.points_list_full += report.list_full;
        self.voxels_forgotten += report.forgotten_voxels;
    }
}
