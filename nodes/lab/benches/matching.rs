//! Matching: one pose of 2000 points against a list, and an alignment from start to end.
//!
//! `cargo bench -p lattice_lab --bench matching`

#![allow(clippy::expect_used)]

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_lab::matching::{AlignOptions, MultiResolutionList, align, sample};
use lattice_lab::simulate::house::{House, LaserOptions, LaserView};
use nalgebra::{Isometry3, Vector3};

/// Side of the finest cells, metres.
const SIDE_M: f64 = 0.1;

fn main() {
    divan::main();
}

/// A map of one scan, another scan, and where it was taken in the map.
struct Pair {
    list: MultiResolutionList,
    lattice: Lattice,
    scan: Cloud,
    truth: Isometry3<f64>,
}

fn pair(kind: LatticeKind) -> Pair {
    let house = House::generated(1).expect("the house stands");
    let views = LaserView::pairs(&house, 1, &LaserOptions::default(), 1).expect("a pair is found");
    let [map, query] = &views[0];
    let cloud = |view: &LaserView, number| Cloud {
        stamp_ns: 0,
        datum_m: Vector3::zeros(),
        offsets_m: view.scan(0.012, 1, number),
    };
    let lattice = Lattice::new(kind, SIDE_M.powi(3)).expect("a cell volume");
    let mut list = MultiResolutionList::new(&lattice, Vector3::zeros(), 3, 1 << 28)
        .expect("three levels are made");
    list.insert(&cloud(map, 0));
    Pair {
        list,
        lattice,
        scan: cloud(query, 1),
        truth: map.house_from_laser.inverse() * query.house_from_laser,
    }
}

#[divan::bench(args = LatticeKind::ALL)]
fn overlap_of_2000_points(bencher: Bencher, kind: LatticeKind) {
    let pair = pair(kind);
    let points = sample(&pair.scan.offsets_m, &pair.lattice, 2000, 0);
    bencher
        .counter(ItemsCount::new(points.len()))
        .bench_local(|| pair.list.overlap(0, black_box(&pair.truth), &points));
}

#[divan::bench(args = LatticeKind::ALL, sample_count = 20)]
fn alignment(bencher: Bencher, kind: LatticeKind) {
    let pair = pair(kind);
    let off = Isometry3::new(Vector3::new(0.15, -0.1, 0.05), Vector3::new(0.0, 0.0, 0.03));
    let (start, options) = (off * pair.truth, AlignOptions::default());
    bencher.bench_local(|| align(&pair.list, &pair.scan, black_box(&start), &options));
}
