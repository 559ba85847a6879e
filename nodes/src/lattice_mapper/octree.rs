//! Octree of the map, with its evidence.

use lattice_core::lattice::MortonKey;
use lattice_msgs::octomap_msgs::Octomap;

use super::state::LatticeMapper;
use crate::octree::{CLASS, LOG_ODDS_OCCUPIED, OctreeError, OctreeForm, OctreeVoxels, UNKNOWN};

/// Limit of an octree in a message, bytes.
pub(super) const MAX_OCTREE_BYTES: usize = 1 << 26;

impl LatticeMapper {
    /// The map as an octree. A voxel has the log-odds of the cell that its centre lies in.
    ///
    /// Occupied are exactly the cells of the map, with log-odds 3.5 where there is no evidence. Free are cells with
    /// evidence below the threshold; without `free_space: evidence` there are none.
    pub fn octomap(&mut self, form: OctreeForm) -> Result<Octomap, OctreeError> {
        let octomap = self.encode_octomap(form);
        self.counts.octomaps_refused += u64::from(octomap.is_err());
        octomap
    }

    fn encode_octomap(&self, form: OctreeForm) -> Result<Octomap, OctreeError> {
        let cells = self.cells();
        let evidence = self.free_space.as_ref().and_then(|free| free.evidence());
        let threshold = evidence.map_or(LOG_ODDS_OCCUPIED, |map| map.occupied_log_odds());
        let mut voxels = OctreeVoxels::new(cells.lattice(), cells.datum_m());
        for key in cells.sorted_keys() {
            voxels.add(key.unpack())?;
        }
        for key in evidence.into_iter().flat_map(|map| map.known_keys()) {
            voxels.add(key.unpack())?;
        }
        let resolution = voxels.resolution_m();
        let tree = voxels.encode(form, threshold, MAX_OCTREE_BYTES, |cell| {
            let Some(key) = MortonKey::pack(cell) else {
                return UNKNOWN;
            };
            let value = evidence.and_then(|map| map.log_odds(key));
            match (cells.contains(key), value) {
                (true, Some(value)) => value.max(threshold),
                (true, None) => LOG_ODDS_OCCUPIED,
                (false, Some(value)) if value < threshold => value,
                (false, _) => UNKNOWN,
            }
        })?;
        Ok(Octomap {
            header: self.header(),
            binary: form == OctreeForm::Binary,
            id: CLASS.to_owned(),
            resolution,
            data: tree.data.into_iter().map(u8::cast_signed).collect(),
        })
    }

    /// State of the octree: epoch, sequence of the voxels, and rays that have added evidence.
    pub(super) fn octomap_state(&self) -> (u64, u64, u64) {
        let (epoch, sequence) = self.state();
        (epoch, sequence, self.counts.rays)
    }
}
