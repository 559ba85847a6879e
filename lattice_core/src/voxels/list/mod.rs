//! Voxel list: construction, lookup, invariants; each kind of change has its own file.

mod changes;
mod checksum;
mod exposed_faces;
mod fill;
mod insert;
mod insert_report;
mod remove;
mod state;
mod when_full;

use std::fmt;

use nalgebra::Vector3;
use rayon::prelude::*;
use thiserror::Error;

use super::distortion::{Distortion, DistortionSums};
use super::store::color_sum::ColorSum;
use super::store::fixed_point::reach;
use super::store::growth;
use super::store::payload_columns::{Columns, Details, LabelCount, Payload, Stamps};
use super::store::shard::{BATCH, Life, SHARDS, Shard, shard_of};
use super::{Region, Voxel, VoxelStore};
use crate::cloud::Cloud;
use crate::lattice::{BlockKey, Lattice, LatticeIndex, MortonKey};

pub use changes::Changes;
pub use insert::PointColumns;
pub use insert_report::InsertReport;
pub use remove::NoStamps;
pub use state::{VoxelList, WhenFull};

/// Datum that is not finite or out of range.
#[derive(Clone, Copy, PartialEq, Debug, Error)]
#[error("datum ({x}, {y}, {z}) m is not finite or more than 2^48 cells from the map origin")]
#[expect(missing_docs, reason = "the messages name the fields")]
pub struct DatumError {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

impl VoxelList {
    /// Creates an empty list of at most `max_voxels`, with the datum at the lattice point nearest to `datum_near_m`
    /// (map frame, metres).
    pub fn new(
        lattice: Lattice,
        datum_near_m: Vector3<f64>,
        max_voxels: usize,
    ) -> Result<VoxelList, DatumError> {
        let index = lattice.quantize_wide(&datum_near_m);
        let [x, y, z] = datum_near_m.into();
        let datum_index = index.ok_or(DatumError { x, y, z })?;
        Ok(VoxelList::at_datum(lattice, datum_index, max_voxels))
    }

    pub(super) fn at_datum(
        lattice: Lattice,
        datum_index: [i64; 3],
        max_voxels: usize,
    ) -> VoxelList {
        VoxelList {
            datum_m: lattice.center_wide(datum_index),
            shards: vec![Shard::new(&lattice, Columns::new(Payload::default())); SHARDS],
            lattice,
            datum_index,
            max_voxels,
            when_full: WhenFull::default(),
            payload: Payload::default(),
            sums: DistortionSums::default(),
            sequence: 0,
            taken: 0,
        }
    }

    /// Sets the optional columns; the list becomes empty.
    #[must_use]
    pub fn with_payload(self, payload: Payload) -> VoxelList {
        let mut list = VoxelList::at_datum(self.lattice, self.datum_index, self.max_voxels);
        list.payload = payload;
        list.when_full = self.when_full;
        list.shards = vec![Shard::new(&list.lattice, Columns::new(payload)); SHARDS];
        list
    }

    /// Optional columns of the list.
    pub fn payload(&self) -> Payload {
        self.payload
    }

    /// Number of voxels of a payload that fit into `max_bytes` in the worst case, to bound a list.
    ///
    /// A voxel may be alone in its block and may be kept as removed: 350 bytes, compared with 46 on surfaces. A
    /// handful of labels per voxel is assumed.
    pub fn voxels_within(max_bytes: usize, payload: Payload) -> usize {
        let columns = |kept: bool, bytes: usize| if kept { bytes } else { 0 };
        let columns = columns(payload.stamps, 16)
            + columns(payload.labels, 24 + 8 * 8)
            + columns(payload.color, 20);
        // A hash map may be less than half full.
        let removed = 5 * size_of::<(u64, Life)>() / 2;
        let voxel = Shard::VOXEL_BYTES + columns + columns / 4 + removed;
        let first = SHARDS * (Shard::FIRST_BYTES + growth::FIRST * columns);
        max_bytes.saturating_sub(first) / voxel
    }

    pub(super) fn shard(&self, code: BlockKey) -> Option<&Shard> {
        self.shards.get(shard_of(code))
    }

    /// The lattice.
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// Datum: lattice point that keys count from, map frame, metres.
    pub fn datum_m(&self) -> Vector3<f64> {
        self.datum_m
    }

    /// Index of the datum in the lattice of the map frame: `datum_m` is the generator times this.
    pub fn datum_index(&self) -> [i64; 3] {
        self.datum_index
    }

    /// Maximum number of voxels.
    pub fn max_voxels(&self) -> usize {
        self.max_voxels
    }

    /// Number of occupied voxels.
    pub fn len(&self) -> usize {
        self.shards.iter().map(Shard::len).sum()
    }

    /// Tests whether there is no voxel.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Voxel of a cell, if occupied.
    pub fn get(&self, key: MortonKey) -> Option<Voxel> {
        let code = BlockKey::from(key);
        let shard = self.shard(code)?;
        let (_, entry) = shard.get(code)?;
        Some(shard.voxel(code, entry))
    }

    /// Voxels of cells, in the order of the keys; without points where a cell is not occupied. They are read in stages,
    /// so that the cache misses of one stage overlap.
    pub fn get_all(&self, keys: &[MortonKey]) -> Vec<Voxel> {
        let mut voxels = Vec::with_capacity(keys.len());
        let (mut blocks, mut rows) = (Vec::new(), Vec::new());
        for keys in keys.chunks(BATCH) {
            blocks.extend(keys.iter().map(|key| {
                let code = BlockKey::from(*key);
                let shard = self.shard(code)?;
                Some((shard, code, shard.voxels.block_of(code)?))
            }));
            rows.extend(blocks.drain(..).map(|place| {
                let (shard, code, block) = place?;
                Some((shard, code, shard.voxels.find_in(block, code)?))
            }));
            let voxel = |(shard, code, number): (&Shard, BlockKey, u32)| {
                let entry = shard.voxels.rows().get(number as usize)?;
                Some(shard.voxel(code, entry))
            };
            let found = rows.drain(..).map(|row| row.and_then(voxel));
            voxels.extend(found.map(Option::unwrap_or_default));
        }
        voxels
    }

    /// Tests whether a cell is occupied.
    pub fn contains(&self, key: MortonKey) -> bool {
        let code = BlockKey::from(key);
        self.shard(code)
            .is_some_and(|shard| shard.get(code).is_some())
    }

    fn details(&self, key: MortonKey) -> Option<Details> {
        let code = BlockKey::from(key);
        let shard = self.shard(code)?;
        let (number, _) = shard.get(code)?;
        Some(shard.columns.get(number as usize))
    }

    /// Stamps of the first and last point in a cell; `None` if not kept.
    pub fn stamps(&self, key: MortonKey) -> Option<Stamps> {
        self.details(key)?.stamps
    }

    /// Labels of the points in a cell with their counts, by label; empty if not kept.
    pub fn labels(&self, key: MortonKey) -> Vec<LabelCount> {
        self.details(key)
            .map(|details| details.labels)
            .unwrap_or_default()
    }

    /// Sums of the colours of the points in a cell; `None` if not kept.
    pub fn color(&self, key: MortonKey) -> Option<ColorSum> {
        let code = BlockKey::from(key);
        let shard = self.shard(code)?;
        let (number, _) = shard.get(code)?;
        let color = shard.columns.colors.get(number as usize)?;
        Some(ColorSum::from(*color))
    }

    /// Most frequent label of a cell, the smallest of equals.
    pub fn label(&self, key: MortonKey) -> Option<LabelCount> {
        let labels = self.labels(key).into_iter();
        labels.min_by_key(|counted| (std::cmp::Reverse(counted.count), counted.label))
    }

    /// Centre of a cell, map frame, metres.
    pub fn center_m(&self, key: MortonKey) -> Vector3<f64> {
        self.datum_m + self.lattice.center(key.unpack())
    }

    /// All voxels in Morton order.
    pub fn sorted(&self) -> Vec<(MortonKey, Voxel)> {
        let mut voxels: Vec<_> = self
            .shards
            .par_iter()
            .flat_map_iter(|shard| shard.iter().map(move |cell| (shard, cell)))
            .filter_map(|(shard, (code, entry))| Some((code.key()?, shard.voxel(code, entry))))
            .collect();
        voxels.par_sort_unstable_by_key(|&(key, _)| key);
        voxels
    }

    /// All voxels in Morton order, with the optional columns.
    pub(super) fn sorted_columns(&self) -> (Vec<MortonKey>, Vec<Voxel>, Columns) {
        let mut columns = Columns::new(self.payload);
        if self.payload.is_plain() {
            let (keys, voxels) = self.sorted().into_iter().unzip();
            return (keys, voxels, columns);
        }
        let rows = |shard| Shard::iter(shard).enumerate().map(move |row| (shard, row));
        let mut rows: Vec<_> = (self.shards.iter().flat_map(rows))
            .filter_map(|(shard, (number, (code, entry)))| {
                let voxel = shard.voxel(code, entry);
                Some((code.key()?, voxel, &shard.columns, number))
            })
            .collect();
        rows.par_sort_unstable_by_key(|&(key, ..)| key);
        let cells = rows.into_iter().map(|(key, voxel, theirs, number)| {
            columns.push_row(theirs, number);
            (key, voxel)
        });
        let (keys, voxels) = cells.unzip();
        (keys, voxels, columns)
    }

    /// Quantization error over all points ever inserted, including those of removed voxels.
    pub fn distortion(&self) -> Distortion {
        self.sums.summary(&self.lattice)
    }

    /// Clears the list and its statistics; keeps lattice, datum and limit.
    pub fn clear(&mut self) {
        let now = self.advance();
        self.shards.iter_mut().for_each(|shard| shard.clear(now));
        self.sums = DistortionSums::default();
        self.bound_removed();
    }

    /// Validates all invariants; returns the first violation.
    pub fn validate(&self) -> Result<(), String> {
        let reach = reach(&self.lattice);
        if self.len() > self.max_voxels {
            return Err(format!(
                "{} voxels, above the limit of {}",
                self.len(),
                self.max_voxels
            ));
        }
        let mut counted = 0_u64;
        for shard in &self.shards {
            shard.validate()?;
            let mut colors = shard.columns.colors();
            for (code, entry) in shard.iter() {
                let voxel = shard.voxel(code, entry);
                let color = colors.next().unwrap_or_default();
                let wrong = voxel.contradiction(reach);
                if let Some(reason) = wrong.or_else(|| color.contradiction(voxel.count)) {
                    return Err(format!("voxel {:?}: {reason}", code.unpack()));
                }
                if entry.life.touched > self.sequence {
                    return Err(format!("voxel {:?} is of a later state", code.unpack()));
                }
                counted = counted.saturating_add(voxel.count.into());
            }
        }
        if let Some(reason) = self.sums.contradiction(&self.lattice) {
            return Err(reason);
        }
        if counted > self.sums.points {
            return Err(format!(
                "voxels hold {counted} points, statistics {}",
                self.sums.points
            ));
        }
        Ok(())
    }
}

impl VoxelStore for VoxelList {
    fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    fn datum_index(&self) -> [i64; 3] {
        self.datum_index
    }

    fn datum_m(&self) -> Vector3<f64> {
        self.datum_m
    }

    fn len(&self) -> usize {
        VoxelList::len(self)
    }

    fn contains(&self, key: MortonKey) -> bool {
        VoxelList::contains(self, key)
    }

    fn block_mask(&self, block: u64) -> [u64; 8] {
        let code = BlockKey::from_raw(block.saturating_mul(512));
        let shard = code.and_then(|code| self.shard(code));
        shard.map_or([0; 8], |shard| shard.block_mask(block))
    }

    fn mean_m(&self, key: MortonKey) -> Option<Vector3<f64>> {
        let voxel = self.get(key)?;
        Some(self.center_m(key) + Vector3::from(voxel.mean_offset_m()))
    }

    #[inline]
    fn holds(&self, w: LatticeIndex) -> bool {
        let code = BlockKey::pack(w);
        code.is_some_and(|code| {
            self.shard(code)
                .is_some_and(|shard| shard.voxels.holds(code))
        })
    }

    fn sorted_keys(&self) -> Vec<MortonKey> {
        let cells = self.shards.iter().flat_map(Shard::iter);
        let mut keys: Vec<MortonKey> = cells.filter_map(|(code, _)| code.key()).collect();
        keys.par_sort_unstable();
        keys
    }

    fn insert(&mut self, cloud: &Cloud) -> InsertReport {
        VoxelList::insert(self, cloud)
    }

    fn remove(&mut self, key: MortonKey) -> bool {
        let now = self.advance();
        let code = BlockKey::from(key);
        let shard = self.shards.get_mut(shard_of(code));
        let removed = shard.is_some_and(|shard| shard.remove(code, now));
        self.bound_removed();
        removed
    }

    fn keys_in(&self, region: &Region) -> Vec<MortonKey> {
        let cells = self.cells_in(region).into_iter().flatten();
        cells.filter_map(BlockKey::key).collect()
    }

    fn remove_region(&mut self, region: &Region) -> usize {
        let gone = self.cells_in(region);
        let now = self.advance();
        self.remove_at(gone, now)
    }

    fn bytes(&self) -> usize {
        self.shards.iter().map(Shard::bytes).sum()
    }
}

impl fmt::Debug for VoxelList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let datum: [f64; 3] = self.datum_m.into();
        write!(
            f,
            "VoxelList({:?}, datum {datum:?} m, {} voxels)",
            self.lattice,
            self.len()
        )
    }
}

#[cfg(test)]
mod tests;
