//! Latency of single questions to a map of rooms: nearest cells, clearance of a point and of a segment.
//!
//! `cargo bench -p lattice_lab --bench query`; each call is one question, at places that take turns. How
//! paths compare between lattices: `cargo run -p lattice_lab --example paths`.

#![allow(clippy::expect_used)]

use divan::{Bencher, black_box};
use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::query::{Query, Segment};
use lattice_core::voxels::{OccupancyList, VoxelStore};
use lattice_lab::simulate::house::{House, LaserOptions, LaserView};
use nalgebra::Vector3;

/// Side of the cells, metres.
const SIDE_M: f64 = 0.1;
/// Farthest that a clearance is asked for, metres.
const MAX_M: f64 = 2.0;
const KINDS: [LatticeKind; 3] = [LatticeKind::Cubic, LatticeKind::Fcc, LatticeKind::Bcc];

fn main() {
    divan::main();
}

/// A laser's scan as a map, and places around the laser, always the same.
fn rooms(kind: LatticeKind) -> (OccupancyList, Vec<Vector3<f64>>) {
    let house = House::generated(1).expect("the house stands");
    let views = LaserView::pairs(&house, 1, &LaserOptions::default(), 1).expect("a pair is found");
    let [view, _] = &views[0];
    let cloud = Cloud {
        stamp_ns: 0,
        datum_m: Vector3::zeros(),
        offsets_m: view.scan(0.012, 1, 0),
    };
    let lattice = Lattice::new(kind, SIDE_M.powi(3)).expect("a cell volume");
    let mut map = OccupancyList::new(lattice, Vector3::zeros(), 1 << 28).expect("a datum");
    map.insert(&cloud);
    let steps = [0.754_877_666, 0.569_840_291, 0.430_159_709];
    let place = |i: usize| {
        let unit = Vector3::from(steps.map(|step| (i as f64 * step).fract() - 0.5));
        unit.component_mul(&Vector3::new(4.0, 4.0, 1.5))
    };
    (map, (0..512).map(place).collect())
}

/// Times `ask`, which gets the next place each time.
fn each(
    bencher: Bencher,
    kind: LatticeKind,
    ask: impl Fn(&Query<'_, OccupancyList>, &Vector3<f64>) -> f64 + Sync,
) {
    let (map, places) = rooms(kind);
    let query = Query::new(&map);
    let mut next = places.iter().cycle();
    bencher.bench_local(|| next.next().map(|place| ask(black_box(&query), place)));
}

#[divan::bench(args = KINDS)]
fn nearest_8(bencher: Bencher, kind: LatticeKind) {
    each(bencher, kind, |query, place| {
        let found = query.nearest(place, 8).unwrap_or_default();
        found.iter().map(|cell| cell.distance_m).sum()
    });
}

#[divan::bench(args = KINDS)]
fn clearance_of_a_point(bencher: Bencher, kind: LatticeKind) {
    each(bencher, kind, |query, place| {
        let found = query.clearance(place, MAX_M).ok().flatten();
        found.map_or(MAX_M, |clearance| clearance.distance_m)
    });
}

#[divan::bench(args = KINDS)]
fn clearance_of_a_segment_of_1_m(bencher: Bencher, kind: LatticeKind) {
    each(bencher, kind, |query, place| {
        let segment = Segment {
            from_m: *place,
            to_m: place + Vector3::new(0.8, 0.6, 0.0),
        };
        let found = query.clearance(&segment, MAX_M).ok().flatten();
        found.map_or(MAX_M, |clearance| clearance.distance_m)
    });
}
