//! Operations on maps as sorted columns, without a hash table.

use nalgebra::Vector3;
use thiserror::Error;

use super::MapContents;
use super::contents::no_columns;
use crate::lattice::MortonKey;
use crate::voxels::distortion::scaled;
use crate::voxels::store::payload_columns::Columns;
use crate::voxels::{Voxel, set_ops};

/// Incompatible maps; the receiving map is unchanged.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum OperationError {
    /// Different cells.
    #[error(
        "one map is of {ours}, the other of {theirs}: only maps of the same lattice can be combined"
    )]
    Lattice { ours: String, theirs: String },
    /// Cell of the other map out of the key range of the receiving one.
    #[error(
        "cell {cell:?} of the other map is more than 2^20 cells from datum index {datum_index:?}: give both maps datums near each other"
    )]
    OutOfRange {
        cell: [i64; 3],
        datum_index: [i64; 3],
    },
    /// Payload or optional column in only one of the maps.
    #[error("only one of the maps has {0}: drop all but the cells with occupancy only")]
    Payload(&'static str),
}

impl MapContents {
    /// Drops counts, offsets and optional columns; keeps the statistics.
    pub fn drop_payload(&mut self) {
        self.voxels = None;
        self.columns = no_columns();
    }

    /// Re-expresses the cells relative to another datum.
    pub fn with_datum(mut self, datum_index: [i64; 3]) -> Result<MapContents, OperationError> {
        if datum_index == self.datum_index {
            return Ok(self);
        }
        let shift: [i128; 3] =
            [0, 1, 2].map(|i| i128::from(self.datum_index[i]) - i128::from(datum_index[i]));
        let mut moved = Vec::with_capacity(self.keys.len());
        for (place, key) in self.keys.iter().enumerate() {
            let w = key.unpack();
            let shifted = [0, 1, 2].map(|i| i32::try_from(i128::from(w[i]) + shift[i]).ok());
            let key = match shifted {
                [Some(x), Some(y), Some(z)] => MortonKey::pack([x, y, z]),
                _ => None,
            };
            let Some(key) = key else {
                let cell = [0, 1, 2].map(|i| self.datum_index[i].saturating_add(i64::from(w[i])));
                return Err(OperationError::OutOfRange { cell, datum_index });
            };
            moved.push((key, place));
        }
        moved.sort_unstable();
        let voxels = self.voxels.as_ref();
        self.voxels = voxels.map(|voxels| {
            let at = |place: usize| voxels.get(place).copied().unwrap_or_default();
            moved.iter().map(|&(_, place)| at(place)).collect()
        });
        self.columns = self.columns.gather(moved.iter().map(|&(_, place)| place));
        self.keys = moved.into_iter().map(|(key, _)| key).collect();
        self.datum_index = datum_index;
        Ok(self)
    }

    /// Adds all voxels and statistics of `other`, exactly; commutative and associative if the first map defines the
    /// datum.
    pub fn merge(&mut self, other: MapContents) -> Result<(), OperationError> {
        self.expect_cells_of(&other)?;
        self.expect_columns_of(&other)?;
        let other = other.with_datum(self.datum_index)?;
        let room = self.keys.len().saturating_add(other.keys.len());
        let mut keys = Vec::with_capacity(room);
        let mut voxels = Vec::with_capacity(if self.voxels.is_some() { room } else { 0 });
        let mut columns = Columns::new(self.columns.payload());
        let (mut ours, mut theirs) = (0, 0);
        set_ops::walk(&self.keys, &other.keys, |key, side| {
            let mut voxel = Voxel::default();
            columns.push();
            let mut add = |map: &MapContents, place: &mut usize| {
                if let Some(more) = map.voxels.as_ref().and_then(|v| v.get(*place)) {
                    voxel.add(more);
                }
                if !columns.payload().is_plain() {
                    columns.add(keys.len(), &map.columns.get(*place));
                }
                *place += 1;
            };
            if side.is_le() {
                add(self, &mut ours);
            }
            if side.is_ge() {
                add(&other, &mut theirs);
            }
            keys.push(key);
            voxels.extend(self.voxels.is_some().then_some(voxel));
        });
        (self.keys, self.voxels) = (keys, self.voxels.is_some().then_some(voxels));
        self.columns = columns;
        self.sums.add(&other.sums);
        Ok(())
    }

    /// Keeps the cells for which `keep` is true, called in ascending order with key and centre (map frame, metres).
    ///
    /// The statistics count the points of these. Their distances, which are not stored per cell, are scaled in
    /// proportion.
    pub fn retain(&mut self, mut keep: impl FnMut(MortonKey, Vector3<f64>) -> bool) {
        let datum_m = self.datum_m();
        let kept: Vec<bool> = self
            .keys
            .iter()
            .map(|&key| keep(key, datum_m + self.lattice.center(key.unpack())))
            .collect();
        let all = self.keys.len() as u64;
        let mut flags = kept.iter();
        self.keys.retain(|_| flags.next() == Some(&true));
        let places = kept.iter().enumerate().filter(|(_, kept)| **kept);
        self.columns = self.columns.gather(places.map(|(place, _)| place));
        if let Some(voxels) = &mut self.voxels {
            let mut flags = kept.iter();
            voxels.retain(|_| flags.next() == Some(&true));
        }
        if kept.contains(&false) {
            let points = match &self.voxels {
                Some(voxels) => voxels.iter().map(|voxel| u64::from(voxel.count)).sum(),
                // Cells without counts share the points equally.
                None => scaled(self.sums.points.into(), self.keys.len() as u64, all) as u64,
            };
            self.sums = self.sums.of_part(points);
        }
    }

    /// Fails unless both maps have the same cells.
    pub fn expect_cells_of(&self, other: &MapContents) -> Result<(), OperationError> {
        if self.lattice == other.lattice {
            return Ok(());
        }
        Err(OperationError::Lattice {
            ours: format!("{:?}", self.lattice),
            theirs: format!("{:?}", other.lattice),
        })
    }

    fn expect_columns_of(&self, other: &MapContents) -> Result<(), OperationError> {
        let (ours, theirs) = (self.payload(), other.payload());
        for (name, differs) in [
            (
                "point counts",
                self.voxels.is_some() != other.voxels.is_some(),
            ),
            ("stamps", ours.stamps != theirs.stamps),
            ("labels", ours.labels != theirs.labels),
            ("colours", ours.color != theirs.color),
        ] {
            if differs {
                return Err(OperationError::Payload(name));
            }
        }
        Ok(())
    }
}
