//! Free space along rays, against clipping each ray with the polyhedron of every cell near it.

mod clear;
mod map;
mod rays;

use std::collections::{BTreeMap, BTreeSet};

use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeIndex, LatticeKind, MortonKey};
use lattice_core::raycast::{FreeSpaceMap, FreeSpaceOptions};
use nalgebra::Vector3;
use proptest::prelude::*;

const DATUM_M: [f64; 3] = [4e5, -3e5, 200.0];
/// Cells are distinguished to this part of a cell side.
const SLACK: f64 = 1e-9;

fn any_kind() -> impl Strategy<Value = LatticeKind> {
    prop::sample::select(&LatticeKind::ALL[..])
}

fn at(offset: [f64; 3]) -> Vector3<f64> {
    Vector3::from(DATUM_M) + Vector3::from(offset)
}

fn cloud(offsets_m: Vec<[f32; 3]>) -> Cloud {
    Cloud {
        stamp_ns: 0,
        datum_m: Vector3::from(DATUM_M),
        offsets_m,
    }
}

/// A wall across x, a grid of `2 n + 1` points a side, as far apart as a scanner at 0 sees them.
fn wall(x: f32, n: i32) -> Cloud {
    let grid = (-n..=n).flat_map(|i| (-n..=n).map(move |k| [i as f32, k as f32]));
    cloud(grid.map(|[y, z]| [x, y * 0.02 * x, z * 0.02 * x]).collect())
}

fn map_of(lattice: Lattice, options: FreeSpaceOptions) -> FreeSpaceMap {
    FreeSpaceMap::new(lattice, at([0.3, 0.2, 0.1]), options).unwrap()
}

fn map(kind: LatticeKind, options: FreeSpaceOptions) -> FreeSpaceMap {
    map_of(Lattice::new(kind, 0.027).unwrap(), options)
}

fn with_level(free_level: Option<u32>) -> FreeSpaceOptions {
    FreeSpaceOptions {
        free_level,
        ..FreeSpaceOptions::default()
    }
}

fn key_of(map: &FreeSpaceMap, p: &Vector3<f64>) -> Option<MortonKey> {
    MortonKey::pack(map.lattice().quantize(&(p - map.datum_m()))?)
}

/// True if the segment passes through the cell of `w` with all faces moved outwards by `grow_m`.
pub fn crosses(
    lattice: &Lattice,
    w: LatticeIndex,
    [from, to]: [&Vector3<f64>; 2],
    grow_m: f64,
) -> bool {
    let (mut first, mut last) = (0.0_f64, 1.0_f64);
    let (s, d) = (from - lattice.center(w), to - from);
    for &n in lattice.face_neighbors() {
        let n = lattice.center(n);
        let room = 0.5 * n.norm_squared() + grow_m * n.norm() - n.dot(&s);
        let along = n.dot(&d);
        if along > 0.0 {
            last = last.min(room / along);
        } else if along < 0.0 {
            first = first.max(room / along);
        } else if room < 0.0 {
            return false;
        }
    }
    first <= last
}

/// Every cell that the segment comes within `SLACK` of, found from the first by touching cells; true
/// for those that it enters deeper than that.
fn near_cells(
    lattice: &Lattice,
    from: &Vector3<f64>,
    to: &Vector3<f64>,
) -> BTreeMap<LatticeIndex, bool> {
    let slack_m = SLACK * lattice.cell_side_m();
    let mut found = BTreeMap::new();
    let mut open = vec![lattice.quantize(from).unwrap()];
    while let Some(w) = open.pop() {
        if !found.contains_key(&w) && crosses(lattice, w, [from, to], slack_m) {
            let _ = found.insert(w, crosses(lattice, w, [from, to], -slack_m));
            let around = lattice.touching_neighbors().iter();
            open.extend(around.map(|n| [w[0] + n[0], w[1] + n[1], w[2] + n[2]]));
        }
    }
    found
}

/// The cells of a segment in general position.
fn crossed(lattice: &Lattice, from: &Vector3<f64>, to: &Vector3<f64>) -> BTreeSet<LatticeIndex> {
    let near = near_cells(lattice, from, to).into_iter();
    near.filter(|(_, deep)| *deep).map(|(w, _)| w).collect()
}
