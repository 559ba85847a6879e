//! Free space from scans as a 2D scanner on a vehicle and a 64-beam scanner see a yard.
//!
//! `cargo bench -p lattice_core --bench raycast`; throughput is points per second. With the
//! environment variable `VISITS` set, prints time on the processor per cell visit instead.

#![allow(clippy::unwrap_used)]

use std::hint::black_box;

use divan::Bencher;
use divan::counter::ItemsCount;
use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::raycast::{FreeSpaceMap, FreeSpaceOptions, RayBundle, Traversal};
use nalgebra::Vector3;

const SIDES_M: [f64; 3] = [0.1, 0.2, 0.5];
const KINDS: [LatticeKind; 3] = [LatticeKind::Cubic, LatticeKind::Fcc, LatticeKind::Bcc];

struct Scan {
    origin_m: Vector3<f64>,
    cloud: Cloud,
}

/// Range to ground, the walls of a yard, and pillars; none beyond `most_m`.
fn range(origin: &Vector3<f64>, ray: &Vector3<f64>, half: [f64; 2], most_m: f64) -> Option<f64> {
    let mut nearest = f64::INFINITY;
    let mut plane = |distance: f64, along: f64| {
        if along * distance > 0.0 {
            nearest = nearest.min(distance / along);
        }
    };
    plane(-origin.z, ray.z);
    for (i, half) in half.into_iter().enumerate() {
        plane(half - origin[i], ray[i]);
        plane(-half - origin[i], ray[i]);
    }
    for k in 0..24 {
        let k = f64::from(k);
        let center = Vector3::new(half[0] * (0.9 * k).sin(), half[1] * (0.71 * k).cos(), 0.0);
        let to = center - origin;
        let (flat, b) = (ray.x * ray.x + ray.y * ray.y, to.x * ray.x + to.y * ray.y);
        let inside = b * b - flat * (to.x * to.x + to.y * to.y - 0.3 * 0.3);
        if inside > 0.0 && b > inside.sqrt() {
            nearest = nearest.min((b - inside.sqrt()) / flat);
        }
    }
    (nearest < most_m).then_some(nearest)
}

fn scan(
    origin_m: Vector3<f64>,
    rays: impl Iterator<Item = Vector3<f64>>,
    half: [f64; 2],
    most: f64,
) -> Scan {
    let points: Vec<_> = rays
        .filter_map(|ray| Some(origin_m + ray * range(&origin_m, &ray, half, most)?))
        .collect();
    let cloud = Cloud::from_points(0, origin_m, &points);
    Scan { origin_m, cloud }
}

/// 3000 scans of 92 points across the way of a vehicle, mean range 5.3 m.
fn lms200() -> Vec<Scan> {
    let at = |i: u32| {
        let origin = Vector3::new(-90.0 + 0.06 * f64::from(i), 0.013 * f64::from(i % 7), 2.0);
        let rays = (0..92).map(|k| {
            let angle = (f64::from(k) - 45.5) * std::f64::consts::PI / 100.0;
            Vector3::new(0.2 * angle.cos(), angle.sin(), -0.3 * angle.cos()).normalize()
        });
        scan(origin, rays, [200.0, 6.7], 80.0)
    };
    (0..3000).map(at).collect()
}

/// 6 scans of some 33 thousand points, mean range 20 m.
fn os64() -> Vec<Scan> {
    let at = |i: u32| {
        let origin = Vector3::new(f64::from(i), 0.3 * f64::from(i), 1.9);
        let rays = (0..64 * 1024).map(|k| {
            let azimuth = f64::from(k / 64) * std::f64::consts::TAU / 1024.0;
            let up = (f64::from(k % 64) - 31.5) * 0.0092;
            Vector3::new(azimuth.cos(), azimuth.sin(), up).normalize()
        });
        let mut scan = scan(origin, rays, [27.0, 20.0], 40.0);
        // Every second point, so that some 33 thousand are left all around.
        let kept = scan.cloud.offsets_m.iter().step_by(2);
        scan.cloud.offsets_m = kept.copied().collect();
        scan
    };
    (0..6).map(at).collect()
}

fn insert(scans: &[Scan], kind: LatticeKind, side_m: f64) -> (FreeSpaceMap, u64) {
    let lattice = Lattice::new(kind, side_m * side_m * side_m).unwrap();
    let options = FreeSpaceOptions::default();
    let mut map = FreeSpaceMap::new(lattice, Vector3::zeros(), options).unwrap();
    let mut visits = 0;
    for scan in scans {
        let bundle = RayBundle {
            origin_m: scan.origin_m,
            ends: &scan.cloud,
        };
        visits += map.insert_scan(&[bundle]).visits;
    }
    (map, visits)
}

fn points(scans: &[Scan]) -> usize {
    scans.iter().map(|s| s.cloud.len()).sum()
}

fn bench(bencher: Bencher, scans: &[Scan], kind: LatticeKind, side_m: f64) {
    bencher
        .counter(ItemsCount::new(points(scans)))
        .bench_local(|| black_box(insert(scans, kind, side_m)));
}

fn cases() -> Vec<(LatticeKind, f64)> {
    let of = |kind| SIDES_M.map(|side_m| (kind, side_m));
    KINDS.into_iter().flat_map(of).collect()
}

#[divan::bench(args = cases(), sample_count = 5, sample_size = 1)]
fn insert_lms200(bencher: Bencher, (kind, side_m): (LatticeKind, f64)) {
    bench(bencher, &lms200(), kind, side_m);
}

#[divan::bench(args = cases(), sample_count = 5, sample_size = 1)]
fn insert_os64(bencher: Bencher, (kind, side_m): (LatticeKind, f64)) {
    bench(bencher, &os64(), kind, side_m);
}

/// 100 rays of 200 cell sides; items are cells.
#[divan::bench(args = LatticeKind::ALL, sample_count = 20)]
fn walk(bencher: Bencher, kind: LatticeKind) {
    let traversal = Traversal::new(&Lattice::new(kind, 1.0).unwrap());
    let rays: Vec<_> = (0..100)
        .map(|i| {
            let a = f64::from(i) * 2.4;
            let up = f64::from(i) / 50.0 - 1.0;
            let flat = (1.0 - up * up).sqrt();
            Vector3::new(a.cos() * flat, a.sin() * flat, up) * 200.0
        })
        .collect();
    let walk_all = || {
        let mut sum = 0;
        let mut cells = 0;
        for ray in &rays {
            let walked = traversal.walk(&Vector3::zeros(), ray, |w| {
                sum ^= w[0] ^ w[1] ^ w[2];
                std::ops::ControlFlow::Continue(())
            });
            cells += walked.unwrap();
        }
        (sum, cells)
    };
    let cells = walk_all().1;
    bencher
        .counter(ItemsCount::new(cells))
        .bench_local(|| black_box(walk_all()));
}

/// Time on the processor, seconds, which other processes do not add to.
fn cpu_s() -> f64 {
    let times = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap();
    times.split(' ').next().unwrap().parse::<f64>().unwrap() * 1e-9
}

fn print_visits() {
    for (name, scans) in [("lms200", lms200()), ("os64", os64())] {
        let n = points(&scans);
        let far: f64 = scans
            .iter()
            .flat_map(|s| s.cloud.points_m().map(|p| (p - s.origin_m).norm()))
            .sum();
        println!(
            "{name}: {} scans, {n} points, mean range {:.1} m",
            scans.len(),
            far / n as f64
        );
        for (kind, side_m) in cases() {
            let mut best = f64::INFINITY;
            let mut visits = 0;
            let mut bytes = 0;
            let mut known = 0;
            for _ in 0..5 {
                let start = cpu_s();
                let (map, v) = insert(&scans, kind, side_m);
                best = best.min(cpu_s() - start);
                let counts = map.counts();
                (visits, bytes, known) = (v, map.bytes(), counts.free + counts.occupied);
            }
            println!(
                "{kind:5} {side_m} m: {:7.3} Mpoints/s, {:6.2} ns/visit, {:6.1} visits/point, {:.2} B/known cell",
                n as f64 / best * 1e-6,
                best / visits as f64 * 1e9,
                visits as f64 / n as f64,
                bytes as f64 / known as f64,
            );
        }
    }
}

fn main() {
    if std::env::var_os("VISITS").is_some() {
        print_visits();
    } else {
        divan::main();
    }
}
