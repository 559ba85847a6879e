//! Counters of a mapper: clouds and points received, rejected, mapped.

use lattice_core::raycast::ClearReport;
use lattice_core::voxels::InsertReport;
use serde::{Deserialize, Serialize};

/// Counters of one mapper; points of rejected clouds are not counted.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MapperCounts {
    /// Clouds received.
    pub clouds_in: u64,
    /// Clouds rejected: not in the map frame.
    pub clouds_wrong_frame: u64,
    /// Clouds rejected: the data do not match the header.
    pub clouds_malformed: u64,
    /// Clouds rejected: stamp of another time, which would make voxels expire.
    #[serde(default)]
    pub clouds_stamp_jump: u64,
    /// Clouds mapped without labels, where labels are kept.
    #[serde(default)]
    pub clouds_unlabelled: u64,
    /// Clouds mapped without colours, where colours are kept.
    #[serde(default)]
    pub clouds_uncolored: u64,
    /// Points of mapped clouds.
    pub points_in: u64,
    /// Points in the map.
    pub points_mapped: u64,
    /// Points rejected: NaN or infinite.
    pub points_not_finite: u64,
    /// Points rejected: farther from the datum than voxel keys reach.
    pub points_out_of_range: u64,
    /// Points rejected: the map is full (`max_voxels` or `max_map_bytes`).
    pub points_list_full: u64,
    /// Voxels removed because the map was full or they had expired.
    #[serde(default)]
    pub voxels_forgotten: u64,
    /// Clouds without viewpoints, which cleared no voxels.
    #[serde(default)]
    pub clouds_no_viewpoint: u64,
    /// Rays traversed, one for each cell hit by a scan.
    #[serde(default)]
    pub rays: u64,
    /// Voxels cleared by rays.
    #[serde(default)]
    pub voxels_cleared: u64,
    /// Blocks of cells beyond `rays.max_bytes`, where rays clear nothing.
    #[serde(default)]
    pub ray_blocks_refused: u64,
    /// Octrees not made: the map reaches beyond one, or it has too many bytes.
    #[serde(default)]
    pub octomaps_refused: u64,
    /// Updates created.
    pub updates: u64,
    /// Keyframes created.
    pub keyframes: u64,
}

impl MapperCounts {
    /// Adds the result of clearing a scan.
    pub fn add_rays(&mut self, report: &ClearReport) {
        self.rays += report.scan.rays;
        self.voxels_cleared += report.removed.len() as u64;
        self.ray_blocks_refused += report.scan.blocks_refused + report.scan.entries_refused;
    }

    /// Adds the result of an insertion.
    pub fn add(&mut self, report: &InsertReport) {
        self.points_in += report.points;
        self.points_mapped += report.inserted;
        self.points_not_finite += report.not_finite;
        self.points_out_of_range += report.out_of_range;
        self.points_list_full += report.list_full;
        self.voxels_forgotten += report.forgotten_voxels;
    }
}
