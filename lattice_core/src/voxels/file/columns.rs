//! Map as plain columns, for tables and other languages.

use super::MapContents;
use super::contents::no_columns;
use crate::lattice::{Lattice, MortonKey};
use crate::voxels::store::fixed_point::reach;
use crate::voxels::{ColorSum, DistortionSums, LabelCount, Stamps, Voxel};

/// Columns of a map, one row per voxel; validated when they become [`MapContents`].
#[derive(Clone, PartialEq, Debug)]
pub struct MapColumns {
    /// The lattice.
    pub lattice: Lattice,
    /// Index of the datum in the lattice of the map frame.
    pub datum_index: [i64; 3],
    /// Occupied cells, ascending.
    pub keys: Vec<MortonKey>,
    /// Counts and offset sums; `None` in a map of occupied cells only.
    pub voxels: Option<Vec<Voxel>>,
    /// Stamps of the first and the last point, if kept.
    pub stamps: Option<Vec<Stamps>>,
    /// Labels with their counts, ascending, if kept.
    pub labels: Option<Vec<Vec<LabelCount>>>,
    /// Sums of colours, if kept.
    pub colors: Option<Vec<ColorSum>>,
    /// Statistics of all points.
    pub statistics: DistortionSums,
}

/// Invalid columns.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{0}")]
pub struct ColumnsError(String);

impl From<MapContents> for MapColumns {
    fn from(map: MapContents) -> MapColumns {
        let payload = map.payload();
        MapColumns {
            lattice: map.lattice,
            datum_index: map.datum_index,
            keys: map.keys,
            voxels: map.voxels,
            colors: payload.color.then(|| map.columns.colors().collect()),
            stamps: payload.stamps.then_some(map.columns.stamps),
            labels: payload.labels.then_some(map.columns.labels),
            statistics: map.sums,
        }
    }
}

impl TryFrom<MapColumns> for MapContents {
    type Error = ColumnsError;

    fn try_from(columns: MapColumns) -> Result<MapContents, ColumnsError> {
        columns.check().map_err(ColumnsError)?;
        let mut further = no_columns();
        if let Some(stamps) = columns.stamps {
            further.set_stamps(stamps);
        }
        if let Some(labels) = columns.labels {
            further.set_labels(labels);
        }
        if let Some(colors) = columns.colors {
            further.set_colors(colors.into_iter());
        }
        let map = MapContents {
            lattice: columns.lattice,
            datum_index: columns.datum_index,
            keys: columns.keys,
            voxels: columns.voxels,
            columns: further,
            sums: columns.statistics,
        };
        map.check_datum().map_err(ColumnsError)?;
        map.check().map_err(ColumnsError)?;
        Ok(map)
    }
}

impl MapColumns {
    /// Maximum offset of a point from the centre of its cell along an axis, in
    /// [`OFFSET_UNIT_M`](crate::voxels::OFFSET_UNIT_M).
    ///
    /// `count` points sum to at most `count` times that.
    pub fn offset_reach(lattice: &Lattice) -> u64 {
        reach(lattice)
    }

    fn check(&self) -> Result<(), String> {
        let rows = self.keys.len();
        for (name, len) in [
            ("counts", self.voxels.as_ref().map(Vec::len)),
            ("stamps", self.stamps.as_ref().map(Vec::len)),
            ("labels", self.labels.as_ref().map(Vec::len)),
            ("colours", self.colors.as_ref().map(Vec::len)),
        ] {
            if let Some(len) = len.filter(|len| *len != rows) {
                return Err(format!("there are {rows} keys and {len} rows of {name}"));
            }
            if self.voxels.is_none() && len.is_some() {
                return Err(format!("there are {name} without counts"));
            }
        }
        let pairs = self.keys.iter().zip(self.keys.iter().skip(1));
        if let Some((key, next)) = pairs.clone().find(|(key, next)| key >= next) {
            let (key, next) = (key.raw(), next.raw());
            return Err(format!("key {next} follows {key}: keys must ascend"));
        }
        let reach = reach(&self.lattice);
        for (key, voxel) in self.keys.iter().zip(self.voxels.iter().flatten()) {
            if let Some(reason) = voxel.contradiction(reach) {
                return Err(format!("cell {:?}: {reason}", key.unpack()));
            }
        }
        for (key, stamps) in self.keys.iter().zip(self.stamps.iter().flatten()) {
            if stamps.first_ns > stamps.last_ns && *stamps != Stamps::NONE {
                let cell = key.unpack();
                return Err(format!("cell {cell:?}: {stamps:?} end before they begin"));
            }
        }
        for (key, labels) in self.keys.iter().zip(self.labels.iter().flatten()) {
            let mut next = labels.iter().skip(1);
            let ascend = labels
                .iter()
                .all(|known| known.count > 0 && next.next().is_none_or(|n| n.label > known.label));
            if !ascend {
                let cell = key.unpack();
                return Err(format!(
                    "cell {cell:?}: labels {labels:?} do not ascend, or have no points"
                ));
            }
        }
        let counts = self.voxels.iter().flatten().map(|voxel| voxel.count);
        let colors = self.colors.iter().flatten();
        for ((key, color), count) in self.keys.iter().zip(colors).zip(counts) {
            if let Some(reason) = color.contradiction(count) {
                return Err(format!("cell {:?}: {reason}", key.unpack()));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::cloud::Cloud;
    use crate::lattice::LatticeKind;
    use crate::voxels::{Payload, VoxelList};

    fn columns() -> MapColumns {
        let lattice = Lattice::new(LatticeKind::Fcc, 0.1).unwrap();
        let list = VoxelList::new(lattice, Vector3::zeros(), 100).unwrap();
        let mut list = list.with_payload(Payload {
            stamps: true,
            labels: true,
            color: true,
        });
        let points_m: Vec<_> = (0..20)
            .map(|i| Vector3::new(f64::from(i), 1.0, 0.3))
            .collect();
        list.insert(&Cloud::from_points(5, Vector3::zeros(), &points_m));
        MapContents::from_list(&list).into()
    }

    #[test]
    fn columns_make_the_map_that_they_came_from() {
        let map = MapContents::try_from(columns()).unwrap();
        assert_eq!(MapColumns::from(map), columns());
    }

    #[test]
    fn columns_that_no_map_has_are_refused_with_the_numbers() {
        type Spoil = fn(&mut MapColumns);
        let cases: [(&str, Spoil); 10] = [
            ("20 keys and 19 rows of counts", |c| {
                c.voxels.as_mut().unwrap().truncate(19);
            }),
            ("keys must ascend", |c| c.keys.swap(0, 1)),
            ("a voxel without points", |c| {
                c.voxels.as_mut().unwrap()[3].count = 0;
            }),
            ("leave the cell", |c| {
                c.voxels.as_mut().unwrap()[3].sum[1] = 1 << 40;
            }),
            ("stamps without counts", |c| c.voxels = None),
            ("end before they begin", |c| {
                let wrong = Stamps {
                    first_ns: 5,
                    last_ns: 4,
                };
                c.stamps.as_mut().unwrap()[7] = wrong;
            }),
            ("do not ascend", |c| {
                c.labels.as_mut().unwrap()[0] = vec![LabelCount { label: 3, count: 0 }];
            }),
            ("rows of colours", |c| {
                c.colors.as_mut().unwrap().truncate(3)
            }),
            ("2 coloured points of 1", |c| {
                c.colors.as_mut().unwrap()[0].count = 2;
            }),
            ("statistics 19", |c| c.statistics.points = 19),
        ];
        for (expected, spoil) in cases {
            let mut columns = columns();
            spoil(&mut columns);
            let error = MapContents::try_from(columns).unwrap_err().to_string();
            assert!(error.contains(expected), "{expected}: {error}");
        }
    }
}
