//! Report of a `lattice_mapper`.

use lattice_core::voxels::Distortion;
use lattice_msgs::cdr;
use serde::{Deserialize, Serialize};

use super::{CorrectionCounts, LatticeMapper, MapperCounts};

/// Report of a `lattice_mapper`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapperReport {
    /// Name of the lattice.
    pub lattice: String,
    /// Volume of one cell.
    pub cell_volume_m3: f64,
    /// Counters of the state machine.
    pub counts: MapperCounts,
    /// Clouds rejected by a full inbox or overrun before it.
    pub clouds_inbox_full: u64,
    /// Clouds lost on the network.
    #[serde(default)]
    pub clouds_lost_on_network: u64,
    /// Undecodable samples.
    pub undecodable: u64,
    /// Updates dropped by the publisher; a keyframe followed.
    pub updates_not_published: u64,
    /// Keyframe chunks dropped by the publisher.
    #[serde(default)]
    pub chunks_not_published: u64,
    /// Counters of corrections, where they are followed.
    #[serde(default)]
    pub corrections: Option<CorrectionCounts>,
    /// Voxels in the map.
    pub voxels: usize,
    /// Points in the distortion statistics.
    pub points: u64,
    /// Mean squared error per dimension.
    pub mse_per_dimension_m2: f64,
    /// Ryde & Brünig eq. (13).
    pub mean_distance_m: f64,
    /// Root of the mean squared distance.
    pub rms_m: f64,
    /// Largest distance.
    pub max_distance_m: f64,
    /// Bytes of a whole keyframe as CDR.
    pub map_bytes: usize,
    /// CRC-32 of the voxel keys and payloads of that keyframe.
    pub map_crc32: u32,
}

impl MapperReport {
    /// Report of a mapper; creates one keyframe to count its bytes.
    pub fn of(mapper: &mut LatticeMapper) -> Self {
        let Distortion {
            points,
            mse_per_dimension_m2,
            mean_distance_m,
            rms_m,
            max_distance_m,
        } = mapper.distortion();
        let counts = mapper.counts().clone();
        let mut crc = crc32fast::Hasher::new();
        let mut map_bytes = 0;
        for chunk in mapper.keyframe() {
            map_bytes += cdr::to_vec(&chunk).map_or(0, |bytes| bytes.len());
            crc.update(&chunk.keys);
            for count in &chunk.counts {
                crc.update(&count.to_le_bytes());
            }
            for offset in &chunk.mean_offsets {
                crc.update(&offset.to_le_bytes());
            }
        }
        let cells = mapper.cells();
        let lattice = cells.lattice();
        Self {
            lattice: lattice.kind().name().to_owned(),
            cell_volume_m3: lattice.cell_volume_m3(),
            counts,
            clouds_inbox_full: 0,
            clouds_lost_on_network: 0,
            undecodable: 0,
            updates_not_published: 0,
            chunks_not_published: 0,
            corrections: None,
            voxels: cells.len(),
            points,
            mse_per_dimension_m2,
            mean_distance_m,
            rms_m,
            max_distance_m,
            map_bytes,
            map_crc32: crc.finalize(),
        }
    }
}
