//! Quantizers: one point at a time, and batches with and without the vector instructions of the machine.
//!
//! `cargo bench -p lattice_core --bench quantize`

#![allow(clippy::expect_used)]

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use lattice_core::lattice::{BatchQuantizer, BlockKey, Lattice, LatticeKind, Simd};
use nalgebra::{Isometry3, Vector3};

/// Points of a batch: they fit into the caches, so that the kernel is measured and not the memory.
const POINTS: usize = 1 << 14;

fn main() {
    divan::main();
}

/// Points all over a cube of 100 m, always the same (the fractional parts of multiples of irrationals).
fn points_m() -> Vec<[f32; 3]> {
    let steps = [0.754_877_666, 0.569_840_291, 0.430_159_709];
    let coordinate = |i: usize, step: f64| ((i as f64 * step).fract() * 100.0 - 50.0) as f32;
    let points = (0..POINTS).map(|i| steps.map(|step| coordinate(i, step)));
    points.collect()
}

fn lattice(kind: LatticeKind) -> Lattice {
    Lattice::new(kind, 0.008).expect("0.008 m^3 is a cell volume")
}

#[divan::bench(args = LatticeKind::ALL)]
fn single_points(bencher: Bencher, kind: LatticeKind) {
    let (lattice, points) = (lattice(kind), points_m());
    bencher.counter(ItemsCount::new(POINTS)).bench_local(|| {
        let codes = points.iter().filter_map(|p| {
            let w = lattice.quantize(&Vector3::from(p.map(f64::from)))?;
            BlockKey::pack(w)
        });
        codes.fold(0, |sum, code| sum ^ black_box(code).raw())
    });
}

#[divan::bench(args = LatticeKind::ALL)]
fn batch(bencher: Bencher, kind: LatticeKind) {
    run_batch(bencher, kind, Isometry3::identity(), Simd::detect());
}

#[divan::bench(args = LatticeKind::ALL)]
fn batch_portable(bencher: Bencher, kind: LatticeKind) {
    run_batch(bencher, kind, Isometry3::identity(), Simd::Portable);
}

#[divan::bench(args = LatticeKind::ALL)]
fn batch_transformed(bencher: Bencher, kind: LatticeKind) {
    let pose = Isometry3::new(Vector3::new(3.0, -7.0, 1.0), Vector3::new(0.1, -0.2, 0.7));
    run_batch(bencher, kind, pose, Simd::detect());
}

fn run_batch(bencher: Bencher, kind: LatticeKind, pose: Isometry3<f64>, simd: Simd) {
    let quantizer = BatchQuantizer::with_simd(&lattice(kind), pose, simd);
    let (points, mut codes) = (points_m(), Vec::with_capacity(POINTS));
    bencher
        .counter(ItemsCount::new(POINTS))
        .bench_local(move || {
            codes.clear();
            quantizer.codes(black_box(&points), &mut codes);
            black_box(codes.last().copied())
        });
}
