//! A map at several resolutions.

use crate::AnyError;
use lattice_core::cloud::Cloud;
use lattice_core::lattice::Lattice;
use lattice_core::voxels::{InsertReport, OccupancyList, VoxelStore};
use nalgebra::Vector3;

/// Limit of levels of a list.
const MAX_LEVELS: usize = 12;

/// Occupied cells of one lattice at several sizes: level 0 is the finest, and the cell size doubles from level to
/// level.
///
/// Every point is quantized at every level, since the cells of a finer level do not nest in those of a coarser one.
#[derive(Clone, Debug)]
pub struct MultiResolutionList {
    levels: Vec<OccupancyList>,
}

impl MultiResolutionList {
    /// Creates an empty list of `levels` levels, the finest with the cells of `finest`, their datums near
    /// `datum_near_m` (map frame, metres). All levels together hold at most `max_bytes`.
    pub fn new(
        finest: &Lattice,
        datum_near_m: Vector3<f64>,
        levels: usize,
        max_bytes: usize,
    ) -> Result<MultiResolutionList, AnyError> {
        if !(1..=MAX_LEVELS).contains(&levels) {
            return Err(format!("{levels} levels, from 1 to {MAX_LEVELS} are taken").into());
        }
        let level = |level: usize| {
            let lattice = finest.scaled((1_u32 << level) as f64)?;
            Ok(OccupancyList::new(
                lattice,
                datum_near_m,
                max_bytes / levels,
            )?)
        };
        let levels: Result<_, AnyError> = (0..levels).map(level).collect();
        Ok(MultiResolutionList { levels: levels? })
    }

    /// Adds a cloud to every level; returns the counts of its points by level, finest first.
    ///
    /// The outcome does not depend on the number of threads.
    pub fn insert(&mut self, cloud: &Cloud) -> Vec<InsertReport> {
        let levels = self.levels.iter_mut();
        levels.map(|list| list.insert(cloud)).collect()
    }

    /// Lists by level, finest first; at least one.
    pub fn levels(&self) -> &[OccupancyList] {
        &self.levels
    }

    /// True if no level has a voxel.
    pub fn is_empty(&self) -> bool {
        self.levels.iter().all(VoxelStore::is_empty)
    }
}
