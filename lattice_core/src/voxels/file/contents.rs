//! Contents of a map file, in key order.

use nalgebra::Vector3;

use crate::lattice::{Lattice, MortonKey};
use crate::voxels::distortion::DistortionSums;
use crate::voxels::store::payload_columns::Columns;
use crate::voxels::{Distortion, OccupancyList, Payload, Voxel, VoxelList, VoxelStore};

/// Map as sorted columns, for files and set operations.
///
/// Keys ascend strictly; voxels and optional columns have one row per key, if present.
#[derive(Clone, PartialEq, Debug)]
pub struct MapContents {
    pub(super) lattice: Lattice,
    pub(super) datum_index: [i64; 3],
    pub(super) keys: Vec<MortonKey>,
    pub(super) voxels: Option<Vec<Voxel>>,
    /// Empty without voxels.
    pub(super) columns: Columns,
    pub(super) sums: DistortionSums,
}

impl MapContents {
    /// Copies a list.
    pub fn from_list(list: &VoxelList) -> MapContents {
        let (keys, voxels, columns) = list.sorted_columns();
        MapContents {
            lattice: list.lattice.clone(),
            datum_index: list.datum_index,
            keys,
            voxels: Some(voxels),
            columns,
            sums: list.sums,
        }
    }

    /// Copies the occupied cells of any store.
    pub fn from_store(store: &(impl VoxelStore + ?Sized)) -> MapContents {
        MapContents {
            lattice: store.lattice().clone(),
            datum_index: store.datum_index(),
            keys: store.sorted_keys(),
            voxels: None,
            columns: no_columns(),
            sums: DistortionSums::default(),
        }
    }

    /// Converts to a list of at most `max_voxels`; further voxels are dropped.
    ///
    /// A map without payload becomes one with a point at each centre and matching statistics.
    pub fn into_list(self, max_voxels: usize) -> VoxelList {
        let payload = self.payload();
        self.into_list_with(payload, max_voxels)
    }

    /// [`MapContents::into_list`] with other optional columns, empty where the map has none.
    pub fn into_list_with(self, payload: Payload, max_voxels: usize) -> VoxelList {
        let list = VoxelList::at_datum(self.lattice, self.datum_index, max_voxels);
        let mut list = list.with_payload(payload);
        let keys = self.keys.iter().copied();
        match self.voxels {
            Some(voxels) => {
                list.fill(keys.zip(voxels), &self.columns);
                list.sums = self.sums;
            }
            None => {
                let (count, sum) = (1, [0; 3]);
                let voxels = std::iter::repeat(Voxel { count, sum });
                list.fill(keys.zip(voxels), &self.columns);
                list.sums.points = self.keys.len() as u64;
            }
        }
        list
    }

    /// Converts to an occupancy list of the cells that fit into `max_bytes`.
    pub fn into_occupancy(self, max_bytes: usize) -> OccupancyList {
        OccupancyList::from_keys(self.lattice, self.datum_index, self.keys, max_bytes)
    }

    /// The lattice.
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// Index of the datum in the lattice of the map frame.
    pub fn datum_index(&self) -> [i64; 3] {
        self.datum_index
    }

    /// Datum: lattice point that keys count from, map frame, metres.
    pub fn datum_m(&self) -> Vector3<f64> {
        self.lattice.center_wide(self.datum_index)
    }

    /// Occupied cells in ascending (Morton) order.
    pub fn keys(&self) -> &[MortonKey] {
        &self.keys
    }

    /// Takes the occupied cells.
    pub fn into_keys(self) -> Vec<MortonKey> {
        self.keys
    }

    /// Payload per key, if present.
    pub fn voxels(&self) -> Option<&[Voxel]> {
        self.voxels.as_deref()
    }

    /// Optional columns that are present.
    pub fn payload(&self) -> Payload {
        self.columns.payload()
    }

    /// Quantization error over all points that were ever inserted.
    pub fn distortion(&self) -> Distortion {
        self.sums.summary(&self.lattice)
    }

    /// Centre of a cell, map frame, metres.
    pub fn center_m(&self, key: MortonKey) -> Vector3<f64> {
        self.datum_m() + self.lattice.center(key.unpack())
    }

    /// Validates the datum.
    pub(super) fn check_datum(&self) -> Result<(), String> {
        match self.lattice.quantize_wide(&self.datum_m()) {
            Some(_) => Ok(()),
            None => Err(format!(
                "datum index {:?} is out of range",
                self.datum_index
            )),
        }
    }

    /// Validates the statistics; keys and voxels are validated when read.
    pub(super) fn check(&self) -> Result<(), String> {
        if let Some(reason) = self.sums.contradiction(&self.lattice) {
            return Err(reason);
        }
        let counts = self.voxels.iter().flatten().map(|voxel| voxel.count);
        let counted = counts.fold(0, |sum: u64, count| sum.saturating_add(u64::from(count)));
        if counted > self.sums.points {
            return Err(format!(
                "voxels hold {counted} points, statistics {}",
                self.sums.points
            ));
        }
        Ok(())
    }
}

pub(super) fn no_columns() -> Columns {
    Columns::new(Payload::default())
}
