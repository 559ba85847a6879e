//! Messages of the map: updates, keyframes, centres and free cells.

use lattice_core::lattice::MortonKey;
use lattice_core::voxels::VoxelStore;
use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};
use lattice_msgs::sensor_msgs::{PointCloud2, PointField};

use super::state::LatticeMapper;
use crate::convert::{cloud, map};

impl LatticeMapper {
    /// Changes since the last update, as one step of the sequence; empty when there are none.
    pub fn take_update(&mut self) -> Vec<LatticeMapUpdate> {
        let changes = self.take_changes();
        if changes.changed.is_empty() && changes.removed.is_empty() {
            return Vec::new();
        }
        let previous = self.sequence;
        self.sequence += 1;
        let (stamp, list) = (self.stamp(), &self.list);
        let mut messages = match &self.occupancy {
            Some(_) => {
                map::update_of_cells(list.lattice(), list.datum_m(), &changes, previous, &stamp)
            }
            None => map::update(list, &changes, previous, &stamp),
        };
        let voxels = self.cells().len();
        self.history = map::sign(&mut messages, self.history, self.sequence, voxels);
        self.counts.updates += 1;
        messages
    }

    /// Cell centres in the map frame, with the number of points (1 if not kept) as `intensity`, the most frequent label as
    /// `label` if labels are kept, and the mean colour as `rgb` if colours are kept: black where no point has one.
    pub fn centers(&self) -> PointCloud2 {
        let voxels: Vec<(MortonKey, u32)> = match &self.occupancy {
            Some(cells) => (cells.sorted_keys().into_iter())
                .map(|key| (key, 1))
                .collect(),
            None => (self.list.sorted().into_iter())
                .map(|(key, voxel)| (key, voxel.count))
                .collect(),
        };
        let kept = self.list.payload();
        let mut fields = cloud::xyz_fields(PointField::FLOAT32, 4);
        fields.push(cloud::field("intensity", 12, PointField::FLOAT32));
        if kept.labels {
            fields.push(cloud::field("label", 16, PointField::UINT16));
        }
        if kept.color {
            let offset = 4 * fields.len() as u32;
            fields.push(cloud::field("rgb", offset, PointField::FLOAT32));
        }
        let point_step = 4 * fields.len() as u32;
        let mut data = Vec::with_capacity(voxels.len() * point_step as usize);
        for (key, count) in &voxels {
            let center = self.list.center_m(*key);
            for v in [center.x, center.y, center.z, f64::from(*count)] {
                data.extend_from_slice(&(v as f32).to_le_bytes());
            }
            if kept.labels {
                let (label, _) = map::main_label(&self.list, *key);
                // Padded to four bytes.
                data.extend_from_slice(&u32::from(label).to_le_bytes());
            }
            if kept.color {
                let color = map::VoxelColor::of_cell(&self.list, *key);
                let [r, g, b] = color.map_or([0; 3], |color| color.rgb);
                // As PCL packs it.
                data.extend_from_slice(&[b, g, r, 0]);
            }
        }
        cloud::dense_cloud(self.header(), fields, point_step, voxels.len(), data)
    }

    /// The whole map in self-contained chunks.
    ///
    /// It may contain changes that the next update repeats: updates carry states, not
    /// differences, so applying both is harmless.
    pub fn keyframe(&mut self) -> Vec<LatticeMap> {
        let stamp = self.stamp();
        let chunks = match &self.occupancy {
            Some(cells) => {
                let keys = cells.sorted_keys();
                map::keyframe_of_cells(cells.lattice(), cells.datum_m(), &keys, &stamp)
            }
            None => map::keyframe(&self.list, &stamp),
        };
        self.counts.keyframes += u64::from(!chunks.is_empty());
        chunks
    }

    /// Free cells in self-contained chunks like those of a map; `None` if none are kept.
    pub fn free(&self) -> Option<Vec<LatticeMap>> {
        let (lattice, keys) = self.free_space.as_ref()?.free_cells()?;
        let datum_m = self.list.datum_m();
        let stamp = self.stamp();
        Some(map::keyframe_of_cells(lattice, datum_m, &keys, &stamp))
    }
}
