//! Compares shortest paths across lattices of equal cell volume in random worlds of balls.
//!
//! `cargo run -p lattice_lab --example paths [WORLDS]`
#![allow(clippy::unwrap_used)]

use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::query::{Bounds, PathError, PathOptions, Query, Steps};
use lattice_core::voxels::VoxelList;
use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::time::Instant;

const SIDE_M: f64 = 10.0;
const CELL_VOLUME_M3: f64 = 0.015625;
const RADIUS_M: f64 = 0.3;
const BALLS: usize = 110;

/// Balls in a cube, their volume as points 1/3 of a cell side apart, and where to go.
struct World {
    points_m: Vec<Vector3<f64>>,
    start_m: Vector3<f64>,
    goal_m: Vector3<f64>,
}

impl World {
    fn random(seed: u64) -> World {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut unit = move || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
        // Ends on opposite sides of the world in a random direction, free of balls.
        let direction = loop {
            let v = Vector3::from_fn(|_, _| 2.0 * unit() - 1.0);
            if v.norm() > 0.1 && v.norm() < 1.0 {
                break v.normalize();
            }
        };
        let (start_m, goal_m) = (direction * -4.3, direction * 4.3);
        let step = 0.25 / 3.0;
        let mut points_m = Vec::new();
        for _ in 0..BALLS {
            let middle = Vector3::from_fn(|_, _| (unit() - 0.5) * SIDE_M);
            let radius = 0.3 + 0.6 * unit();
            let near = |end: &Vector3<f64>| (end - middle).norm() < radius + 1.0;
            if near(&start_m) || near(&goal_m) {
                continue;
            }
            let n = (radius / step).ceil() as i32;
            for i in -n..=n {
                for j in -n..=n {
                    for k in -n..=n {
                        let offset = Vector3::from([i, j, k].map(f64::from)) * step;
                        if offset.norm() <= radius {
                            points_m.push(middle + offset);
                        }
                    }
                }
            }
        }
        World {
            points_m,
            start_m,
            goal_m,
        }
    }
}

/// Result of one search.
struct Found {
    length_m: f64,
    shortened_m: f64,
    expanded: usize,
    seconds: f64,
}

fn search(world: &World, kind: LatticeKind, steps: Steps) -> Option<Found> {
    let lattice = Lattice::new(kind, CELL_VOLUME_M3).unwrap();
    let mut voxels = VoxelList::new(lattice, Vector3::zeros(), usize::MAX).unwrap();
    voxels.insert(&Cloud::from_points(0, Vector3::zeros(), &world.points_m));
    let query = Query::new(&voxels);
    let half = Vector3::repeat(0.5 * SIDE_M);
    let options = PathOptions {
        radius_m: RADIUS_M,
        steps,
        bounds: Some(Bounds {
            min_m: -half,
            max_m: half,
        }),
        max_expanded: 1_000_000,
    };
    let begin = Instant::now();
    let path = match query.shortest_path(&world.start_m, &world.goal_m, &options) {
        Ok(path) => path,
        Err(PathError::NoPath { .. } | PathError::Blocked { .. }) => return None,
        Err(error) => panic!("{error}"),
    };
    let seconds = begin.elapsed().as_secs_f64();
    let short = query.shorten(&path.centers_m, RADIUS_M).unwrap();
    // The ways from the points to the centres of their cells count, so that all go as far.
    let to_centers = (path.centers_m[0] - world.start_m).norm()
        + (path.centers_m[path.centers_m.len() - 1] - world.goal_m).norm();
    Some(Found {
        length_m: path.length_m + to_centers,
        shortened_m: length_m(&short) + to_centers,
        expanded: path.expanded,
        seconds,
    })
}

fn length_m(path_m: &[Vector3<f64>]) -> f64 {
    path_m.windows(2).map(|p| (p[1] - p[0]).norm()).sum()
}

fn main() {
    let count = std::env::args().nth(1).map_or(100, |n| n.parse().unwrap());
    let searches: Vec<_> = LatticeKind::ALL
        .into_iter()
        .flat_map(|kind| [(kind, Steps::Face), (kind, Steps::Touching)])
        .collect();
    // A world counts if every search finds a way.
    let mut all: Vec<Vec<Found>> = Vec::new();
    let mut seed = 0;
    while all.len() < count {
        let world = World::random(seed);
        seed += 1;
        let found = searches
            .iter()
            .map(|&(kind, steps)| search(&world, kind, steps));
        all.extend(found.collect::<Option<Vec<Found>>>());
    }
    let mean = |of: &dyn Fn(&[Found]) -> f64| {
        all.iter().map(|found| of(found)).sum::<f64>() / all.len() as f64
    };
    let best = |found: &[Found]| found.iter().map(|f| f.shortened_m).fold(f64::MAX, f64::min);
    let straight_m = 8.6;
    println!(
        "{count} worlds of {seed}, {BALLS} balls in ({SIDE_M} m)^3, cells of {CELL_VOLUME_M3} m^3, radius {RADIUS_M} m"
    );
    println!(
        "shortest known path: {:.3} of the straight line",
        mean(&|f| best(f) / straight_m)
    );
    println!("| lattice | steps | length / shortest known | shortened | cells expanded | ms |");
    println!("|---|---|---|---|---|---|");
    for (i, (kind, steps)) in searches.iter().enumerate() {
        let lattice = Lattice::new(*kind, CELL_VOLUME_M3).unwrap();
        let n = match steps {
            Steps::Face => lattice.face_neighbors().len(),
            Steps::Touching => lattice.touching_neighbors().len(),
        };
        println!(
            "| {kind} | {n} {steps:?} | {:.4} | {:.4} | {:.0} | {:.1} |",
            mean(&|f| f[i].length_m / best(f)),
            mean(&|f| f[i].shortened_m / best(f)),
            mean(&|f| f[i].expanded as f64),
            mean(&|f| f[i].seconds * 1e3),
        );
    }
}
