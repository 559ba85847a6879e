//! Coarser maps: cells with sides that are a power of two longer.
//!
//! Voronoi cells do not nest, whatever the lattice. What was one cell goes to one coarse cell as a
//! whole, that of its points' centroid if that is known; what is made from a coarser map may
//! therefore differ a little from what is made at once.

use nalgebra::Vector3;
use thiserror::Error;

use super::distortion::DistortionSums;
use super::store::fixed_point::{Offsets, fixed, moment_unit_m, voxel_of};
use super::store::payload_columns::Details;
use super::store::shard::shard_of;
use super::{OccupancyList, Voxel, VoxelList, VoxelStore};
use crate::lattice::{BlockKey, Lattice, LatticeError, LatticeIndex, MortonKey};

/// Highest level: cells of 2^20 sides.
const MAX_LEVEL: u32 = 20;

/// Why there is no coarser map.
#[derive(Clone, PartialEq, Debug, Error)]
pub enum LevelError {
    /// The cells would be too large.
    #[error("no level {level}: {source}")]
    Lattice {
        /// The level asked for.
        level: u32,
        /// What is wrong with its lattice.
        source: LatticeError,
    },
    /// Blocks of the coarser map straddle those of this one, and this one is nearly full.
    #[error("level {level} does not fit into {max_bytes} B")]
    Full {
        /// The level asked for.
        level: u32,
        /// Most bytes of the map.
        max_bytes: usize,
    },
}

/// The lattice of a level, and how its indices count.
struct Level {
    lattice: Lattice,
    datum_index: [i64; 3],
    /// The datum of the finer map from that of the coarser, metres.
    shift_m: Vector3<f64>,
}

impl Level {
    fn new(fine: &Lattice, datum_index: [i64; 3], level: u32) -> Result<Level, LevelError> {
        let sides = (1_i64 << level.min(MAX_LEVEL)) as f64;
        let volume_m3 = fine.cell_volume_m3() * (sides * sides * sides);
        let lattice = match Lattice::new(fine.kind(), volume_m3) {
            Err(LatticeError::NoBasis) => Lattice::from_basis(fine.unoriented_generator() * sides),
            _ if level > MAX_LEVEL => Err(LatticeError::CellVolume(f64::INFINITY)),
            made => made,
        };
        let lattice = lattice.map_err(|source| LevelError::Lattice { level, source })?;
        let coarse = datum_index.map(|i| i >> level);
        let rest = [0, 1, 2].map(|i| (datum_index[i] - (coarse[i] << level)) as i32);
        Ok(Level {
            lattice: lattice.oriented(fine.orientation()),
            datum_index: coarse,
            shift_m: fine.center(rest),
        })
    }

    /// The coarse cell of a point from the datum of the finer map.
    fn cell_of(&self, point_m: Vector3<f64>) -> Option<LatticeIndex> {
        self.lattice.quantize(&(point_m + self.shift_m))
    }
}

impl VoxelList {
    /// The map of cells with sides 2^`level` times as long, `max_voxels` and payload as here.
    ///
    /// A voxel goes to the coarse cell of its centroid, to that of its centre if its count is
    /// saturated. Counts, stamps and labels are exact. So are sums of positions if all indices of the
    /// datum are divisible by 2^`level`; then the datum is the same point. Otherwise it is the lattice
    /// point of the coarser lattice with these indices divided and rounded down, and all positions
    /// are shifted by one rounded step, at most half of [`super::OFFSET_UNIT_M`] off. Second moments
    /// are rounded once for each voxel. The statistics are those of the centroids, each as often as
    /// it has points.
    pub fn coarser(&self, level: u32) -> Result<VoxelList, LevelError> {
        if level == 0 {
            return Ok(self.clone());
        }
        let level = Level::new(&self.lattice, self.datum_index, level)?;
        let lattice = level.lattice.clone();
        let mut list = VoxelList::at_datum(lattice, level.datum_index, self.max_voxels)
            .with_payload(self.payload)
            .with_when_full(self.when_full);
        let now = list.advance();
        for shard in &self.shards {
            for (number, (code, entry)) in shard.iter().enumerate() {
                let details = || shard.columns.get(number);
                let offsets = shard.offsets(code, entry);
                list.take_finer(&level, &self.lattice, (code, offsets), details, now);
            }
        }
        Ok(list)
    }

    fn take_finer(
        &mut self,
        level: &Level,
        fine: &Lattice,
        (code, offsets): (BlockKey, Offsets),
        details: impl FnOnce() -> Details,
        now: u32,
    ) {
        let voxel = voxel_of(offsets);
        let center_m = fine.center(code.unpack());
        let mean_m = match voxel.count {
            u32::MAX => Vector3::zeros(),
            _ => Vector3::from(voxel.mean_offset_m()),
        };
        let Some(w) = level.cell_of(center_m + mean_m) else {
            return;
        };
        let Some(coarse) = BlockKey::pack(w) else {
            return;
        };
        // The finer centre from the coarser one, in whole steps.
        let [from, shift, to] =
            [center_m, level.shift_m, level.lattice.center(w)].map(|p| fixed(p.into()));
        let [.., count] = offsets;
        let mut moved = offsets;
        for (i, sum) in moved.iter_mut().take(3).enumerate() {
            let step = from[i].wrapping_add(shift[i]).wrapping_sub(to[i]);
            *sum = sum.wrapping_add(step.wrapping_mul(count));
        }
        // From the coarse centre.
        let moved_m = center_m + level.shift_m - level.lattice.center(w);
        let Some(shard) = self.shards.get_mut(shard_of(coarse)) else {
            return;
        };
        if let Some(number) = shard.find_or_add(coarse, usize::MAX, now) {
            shard.add_offsets(number, &moved, now);
            if !self.payload.is_plain() {
                let units_m = [fine, &level.lattice].map(moment_unit_m);
                let mut details = details();
                details.moments = moved_moments(details.moments, &voxel, moved_m, units_m);
                shard.columns.add(number as usize, &details);
            }
        }
        let off_m = (moved_m + mean_m).norm();
        self.sums.add(&sums_of(&level.lattice, off_m, voxel.count));
    }
}

/// Second moments about another centre, `moved_m` being the old one seen from it.
fn moved_moments(
    moments: [i64; 6],
    voxel: &Voxel,
    moved_m: Vector3<f64>,
    [old_unit_m, new_unit_m]: [f64; 2],
) -> [i64; 6] {
    let count = f64::from(voxel.count);
    let sum_m = Vector3::from(voxel.mean_offset_m()) * count;
    let axes = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
    let mut moved = [0; 6];
    for ((to, from), (i, j)) in moved.iter_mut().zip(moments).zip(axes) {
        let cross = sum_m[i] * moved_m[j] + moved_m[i] * sum_m[j];
        let about = from as f64 * (old_unit_m * old_unit_m);
        let about = about + cross + count * (moved_m[i] * moved_m[j]);
        *to = (about / (new_unit_m * new_unit_m)).round() as i64;
    }
    moved
}

/// The statistics of `count` points at one distance from their lattice point.
fn sums_of(lattice: &Lattice, distance_m: f64, count: u32) -> DistortionSums {
    const STEPS: f64 = (1_u64 << 20) as f64;
    let sides = distance_m / lattice.cell_side_m();
    let (square, distance) = ((sides * sides * STEPS) as u64, (sides * STEPS) as u64);
    DistortionSums {
        points: count.into(),
        squares: u128::from(square) * u128::from(count),
        distances: u128::from(distance) * u128::from(count),
        largest_square: square,
    }
}

impl OccupancyList {
    /// The map of cells with sides 2^`level` times as long, `max_bytes` as here: the cells that hold
    /// the centres of these. Datum as for [`VoxelList::coarser`].
    pub fn coarser(&self, level: u32) -> Result<OccupancyList, LevelError> {
        if level == 0 {
            return Ok(self.clone());
        }
        let made = Level::new(self.lattice(), self.datum_index(), level)?;
        let max_bytes = self.max_bytes();
        let mut list = OccupancyList::at_datum(made.lattice.clone(), made.datum_index, max_bytes);
        for key in self.sorted_keys() {
            let cell = made.cell_of(self.lattice().center(key.unpack()));
            if let Some(key) = cell.and_then(MortonKey::pack)
                && !list.add(key)
            {
                return Err(LevelError::Full { level, max_bytes });
            }
        }
        Ok(list)
    }
}
