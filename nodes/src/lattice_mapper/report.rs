//! Report of a `lattice_mapper`.

use lattice_core::voxels::Distortion;
use serde::{Deserialize, Serialize};

use super::corrected::CorrectionCounts;
use super::counts::MapperCounts;
use super::state::LatticeMapper;
use crate::convert::map;

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
    /// Bytes of the voxels in a keyframe: keys and payloads, without the headers of its chunks. `None` if the node had to hurry.
    pub map_bytes: Option<usize>,
    /// Checksum of the voxel keys, and of their counts and offsets if kept. `None` if the node had to hurry.
    pub map_checksum: Option<u64>,
}

impl MapperReport {
    /// Report of a mapper, without a keyframe.
    pub fn of(mapper: &LatticeMapper) -> Self {
        let Distortion {
            points,
            mse_per_dimension_m2,
            mean_distance_m,
            rms_m,
            max_distance_m,
        } = mapper.distortion();
        let counts = mapper.counts().clone();
        let cells = mapper.cells();
        // A second for tens of millions of voxels.
        let content = || {
            let keys = cells.sorted_keys();
            let (list, checksum) = match &mapper.occupancy {
                Some(_) => (None, map::changes_sum(&map::Decoded::default(), &keys)),
                None => (Some(mapper.list()), mapper.list().checksum()),
            };
            (map::voxel_bytes(&keys, list), checksum)
        };
        let content = (!mapper.hurry.is_requested()).then(content);
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
            map_bytes: content.map(|(bytes, _)| bytes),
            map_checksum: content.map(|(_, checksum)| checksum),
        }
    }
}

#[cfg(test)]
mod tests {
    use lattice_core::lattice::{Lattice, LatticeKind};
    use lattice_msgs::sensor_msgs::{PointCloud2, PointField};

    use super::*;
    use crate::convert::{cloud, geometry};
    use crate::lattice_mapper::{MapPayload, MapperOptions};

    const MANY: u32 = 200_000;

    /// Points 1 m apart.
    fn points(count: u32) -> PointCloud2 {
        let place = |i: u32| [i % 64, i / 64 % 64, i / 4096].map(|v| v as f32 + 0.3);
        let data: Vec<u8> = (0..count)
            .flat_map(|i| place(i).into_iter().flat_map(f32::to_le_bytes))
            .collect();
        let fields = cloud::xyz_fields(PointField::FLOAT32, 4);
        let header = geometry::header("map", 1);
        cloud::dense_cloud(header, fields, 12, count as usize, data)
    }

    fn mapper(payload: MapPayload, count: u32) -> LatticeMapper {
        let lattice = Lattice::new(LatticeKind::Cubic, 1.0).unwrap();
        let mut options = MapperOptions::new(lattice);
        options.payload = payload;
        let mut mapper = LatticeMapper::new(options, 1).unwrap();
        mapper.on_cloud(&points(count)).unwrap();
        mapper
    }

    #[test]
    fn bytes_are_those_of_a_keyframe_that_is_not_made() {
        for payload in [MapPayload::default(), MapPayload::Occupancy] {
            let mut mapper = mapper(payload, MANY);
            let report = MapperReport::of(&mapper);
            assert_eq!((report.counts.keyframes, report.voxels), (0, MANY as usize));
            let chunks = mapper.keyframe();
            let bytes = chunks.iter().map(|chunk| {
                chunk.keys.len() + 4 * chunk.counts.len() + 2 * chunk.mean_offsets.len()
            });
            let bytes: usize = bytes.sum();
            // Each chunk begins with a whole key.
            let map_bytes = report.map_bytes.unwrap();
            let most = map_bytes + 10 * chunks.len();
            assert!((map_bytes..=most).contains(&bytes), "{payload:?}");
            assert!(chunks.len() > 1);
        }
    }

    #[test]
    fn the_checksum_is_that_of_the_map() {
        for payload in [MapPayload::default(), MapPayload::Occupancy] {
            let checksum = |count| MapperReport::of(&mapper(payload, count)).map_checksum;
            assert_eq!(checksum(5000), checksum(5000), "{payload:?}");
            assert_ne!(checksum(5000), checksum(4999), "{payload:?}");
        }
    }
}
