//! Counters of a mapper: clouds and points taken, refused, mapped.

use lattice_core::raycast::ClearReport;
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
    /// Clouds refused: of another time than those before, by which voxels grow old.
    #[serde(default)]
    pub clouds_stamp_jump: u64,
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
    /// Clouds without the place of the sensor, where rays clear voxels: they cleared none.
    #[serde(default)]
    pub clouds_no_viewpoint: u64,
    /// Rays that were followed, one for each cell that a scan hit.
    #[serde(default)]
    pub rays: u64,
    /// Voxels that went because rays passed through them.
    #[serde(default)]
    pub voxels_cleared: u64,
    /// Times that a block of cells had no room in `rays.max_bytes`: rays there clear nothing.
    #[serde(default)]
    pub ray_blocks_refused: u64,
    /// Update steps made.
    pub updates: u64,
    /// Keyframes made.
    pub keyframes: u64,
}

impl MapperCounts {
    /// Adds what the rays of a scan did.
    pub fn add_rays(&mut self, report: &ClearReport) {
        self.rays += report.scan.rays;
        self.voxels_cleared += report.removed.len() as u64;
        self.ray_blocks_refused += report.scan.blocks_refused + report.scan.entries_refused;
    }

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
