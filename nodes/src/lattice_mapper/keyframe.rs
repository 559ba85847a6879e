//! Messages of the whole map, and of all free cells.

use lattice_core::voxels::VoxelStore;
use lattice_msgs::lattice::LatticeMap;

use super::LatticeMapper;
use crate::convert::map;

impl LatticeMapper {
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
