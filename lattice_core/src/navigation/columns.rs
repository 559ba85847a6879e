//! Samples of the voxels, in columns of the grid.

use nalgebra::Vector3;

use super::tiles::{Column, Tiles};
use crate::lattice::{Lattice, MortonKey};

/// Maximum of a column's numbers.
const MAX_COLUMN: f64 = (1_u32 << 30) as f64;

/// Half the width of the window of a column beyond half its own width, in cell sizes of the lattice: cells beside the
/// column have their mean in it.
const WINDOW_SIDES: f64 = 0.75;

/// Shortest stride, metres: over less, an inclination is the noise of the points.
const MIN_STRIDE_M: f64 = 0.1;

/// Longest stride, columns: bounds the work where cells are millimetres.
const MAX_STRIDE: i32 = 16;

/// Steps of a cell's edge to which means are rounded: each scan moves them a little, which must not cost anything.
const MEAN_STEPS: f64 = 64.0;

/// Mean point of a voxel, map frame, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sample {
    key: MortonKey,
    pub(super) at_m: Vector3<f64>,
}

/// Samples of a map by column.
#[derive(Clone)]
pub(super) struct Columns {
    lattice: Lattice,
    datum_m: Vector3<f64>,
    /// Edge of the columns, metres.
    pub(super) resolution_m: f64,
    /// Half the width of the window of a column, metres.
    pub(super) window_m: f64,
    /// Samples by the column of their cell's centre, in ascending order of keys.
    bins: Tiles<Vec<Sample>>,
}

impl Columns {
    pub(super) fn new(lattice: &Lattice, datum_m: Vector3<f64>, resolution_m: f64) -> Columns {
        Columns {
            lattice: lattice.clone(),
            datum_m,
            resolution_m,
            window_m: 0.5 * resolution_m + WINDOW_SIDES * lattice.cell_side_m(),
            bins: Tiles::default(),
        }
    }

    /// Edge of a cube with the volume of a cell, metres.
    pub(super) fn side_m(&self) -> f64 {
        self.lattice.cell_side_m()
    }

    /// Column of a position, if it is in range.
    pub(super) fn column_of(&self, x_m: f64, y_m: f64) -> Option<Column> {
        let [x, y] = [x_m, y_m].map(|value| (value / self.resolution_m).floor());
        (x.abs() < MAX_COLUMN && y.abs() < MAX_COLUMN).then_some([x as i32, y as i32])
    }

    /// Centre of a column, metres.
    pub(super) fn center_m(&self, column: Column) -> [f64; 2] {
        column.map(|i| (f64::from(i) + 0.5) * self.resolution_m)
    }

    /// Columns on each side whose bins have samples of a column.
    pub(super) fn reach(&self) -> i32 {
        let reach_m = self.window_m + self.lattice.covering_radius_m();
        (reach_m / self.resolution_m + 0.5).floor() as i32
    }

    /// Columns over which inclinations are judged: at least those that one cell of the lattice blurs.
    pub(super) fn stride(&self) -> i32 {
        let stride_m = self.side_m().max(MIN_STRIDE_M);
        ((stride_m / self.resolution_m).round() as i32).clamp(1, MAX_STRIDE)
    }

    /// Sets or removes the sample of a voxel; returns its column, if it changed.
    pub(super) fn set(&mut self, key: MortonKey, offset_m: Option<Vector3<f64>>) -> Option<Column> {
        let center_m = self.datum_m + self.lattice.center(key.unpack());
        let column = self.column_of(center_m.x, center_m.y)?;
        let step_m = self.side_m() / MEAN_STEPS;
        let sample = offset_m.map(|offset_m| Sample {
            key,
            at_m: center_m + offset_m.map(|offset_m| (offset_m / step_m).round() * step_m),
        });
        let sample = sample.filter(|sample| sample.at_m.iter().all(|value| value.is_finite()));
        let changed = self.bins.update(column, |bin| {
            let samples = bin.get_or_insert_default();
            let changed = set_sample(samples, key, sample);
            if samples.is_empty() {
                *bin = None;
            }
            changed
        });
        changed.filter(|changed| *changed).map(|_| column)
    }

    /// Samples in the window of a column, lowest first, as offsets from its centre in x and y and as heights.
    pub(super) fn window(&self, column: Column) -> Vec<Vector3<f64>> {
        let [x_m, y_m] = self.center_m(column);
        let mut found: Vec<(MortonKey, Vector3<f64>)> = Vec::new();
        self.bins.for_square(column, self.reach(), |bin| {
            found.extend(bin.iter().filter_map(|sample| {
                let at_m = sample.at_m - Vector3::new(x_m, y_m, 0.0);
                let inside = at_m.x.abs() <= self.window_m && at_m.y.abs() <= self.window_m;
                inside.then_some((sample.key, at_m))
            }));
        });
        found.sort_unstable_by(|(a, p), (b, q)| p.z.total_cmp(&q.z).then(a.cmp(b)));
        found.into_iter().map(|(_, at_m)| at_m).collect()
    }

    /// Columns with samples, unordered.
    pub(super) fn occupied(&self) -> impl Iterator<Item = Column> {
        self.bins.iter().map(|(column, _)| column)
    }

    /// All samples, unordered.
    pub(super) fn samples(&self) -> impl Iterator<Item = &Sample> {
        self.bins.iter().flat_map(|(_, bin)| bin)
    }
}

/// Sets or removes the sample of a voxel among those of a bin; returns whether they changed.
fn set_sample(bin: &mut Vec<Sample>, key: MortonKey, sample: Option<Sample>) -> bool {
    let found = bin.binary_search_by_key(&key, |sample| sample.key);
    match (found, sample) {
        (Ok(i), Some(sample)) => match bin.get_mut(i) {
            Some(old) if *old != sample => {
                *old = sample;
                true
            }
            _ => false,
        },
        (Ok(i), None) => {
            bin.remove(i);
            true
        }
        (Err(i), Some(sample)) => {
            bin.insert(i, sample);
            true
        }
        (Err(_), None) => false,
    }
}
