//! Compares shortest paths across lattices of equal cell volume in random worlds of balls.
//!
//! `cargo run -p lattice_lab --example paths [WORLDS]`
//!
//! `cargo run --release -p lattice_lab --example paths town`: paths of 150 m through a town of 0.1 m cells, timed.
#![allow(clippy::unwrap_used)]

use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::query::{Bounds, PathError, PathOptions, Query, Steps};
use lattice_core::voxels::{OccupancyList, VoxelList, VoxelStore};
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

/// Streets between blocks of houses of 12 m by 12 m, each with an open side and a yard, 200 m by 120 m. Walls with
/// gates of 1.5 m close all streets.
fn town(lattice: &Lattice) -> OccupancyList {
    let mut cells = OccupancyList::at_datum(lattice.clone(), [0; 3], usize::MAX);
    let step = 0.7 * lattice.cell_side_m();
    let mut fill = |from: [f64; 3], to: [f64; 3]| {
        let n = [0, 1, 2].map(|axis| ((to[axis] - from[axis]) / step).ceil() as i32);
        for i in 0..=n[0] {
            for j in 0..=n[1] {
                for k in 0..=n[2] {
                    let by = Vector3::from([i, j, k].map(f64::from)) * step;
                    cells.add(cells.key_of(&(Vector3::from(from) + by)).unwrap());
                }
            }
        }
    };
    fill([-100.0, -60.0, 0.0], [100.0, 60.0, 0.0]);
    for (column, row) in (0..60).map(|i| (i % 10, i / 10)) {
        let (x, y) = (
            -98.0 + 20.0 * f64::from(column),
            -56.0 + 20.0 * f64::from(row),
        );
        let height = 4.0 + f64::from((7 * column + 5 * row) % 6);
        let (gate_x, gate_y) = (
            x + 14.0 + f64::from(row % 3),
            y + 15.0 + f64::from(column % 2),
        );
        let mut wall = |from: [f64; 2], to: [f64; 2]| {
            fill([from[0], from[1], 0.0], [to[0], to[1], height]);
        };
        wall([x, y], [x + 12.0, y]);
        wall([x, y + 12.0], [x + 12.0, y + 12.0]);
        wall([x, y], [x, y + 12.0]);
        wall([x + 12.0, y], [x + 12.0, y + 4.0]);
        wall([x + 12.0, y + 6.0], [x + 12.0, y + 12.0]);
        wall([x + 12.0, y + 3.0], [gate_x, y + 3.0]);
        wall([gate_x + 1.5, y + 3.0], [x + 20.0, y + 3.0]);
        wall([x + 3.0, y + 12.0], [x + 3.0, gate_y]);
        wall([x + 3.0, gate_y + 1.5], [x + 3.0, y + 20.0]);
        fill([x, y, height], [x + 6.0, y + 12.0, height]);
    }
    cells
}

/// Times paths of a ball of 0.4 m through the town, below 2 m and above the roofs as well.
fn time_in_town() {
    println!("| lattice | voxels | below m | search | length m | cells expanded | s |");
    println!("|---|---|---|---|---|---|---|");
    for kind in LatticeKind::ALL {
        let cells = town(&Lattice::new(kind, 0.001).unwrap());
        let query = Query::new(&cells);
        for top_m in [2.0, 20.0] {
            let options = PathOptions {
                radius_m: 0.4,
                steps: Steps::Touching,
                bounds: Some(Bounds {
                    min_m: Vector3::new(-100.0, -60.0, 0.0),
                    max_m: Vector3::new(100.0, 60.0, top_m),
                }),
                max_expanded: 20_000_000,
            };
            let ends = [[-70.0, -38.0, 1.0], [70.0, 22.0, 1.0]].map(Vector3::from);
            for name in ["straight", "shortest"] {
                let begin = Instant::now();
                let path = match name {
                    "straight" => query.straight_path(&ends[0], &ends[1], &options).unwrap(),
                    _ => query.shortest_path(&ends[0], &ends[1], &options).unwrap(),
                };
                let short = query.shorten(&path.centers_m, 0.4).unwrap();
                println!(
                    "| {kind} | {} | {top_m} | {name} | {:.2} | {} | {:.2} |",
                    cells.len(),
                    length_m(&short),
                    path.expanded,
                    begin.elapsed().as_secs_f64(),
                );
            }
        }
    }
}

fn main() {
    if std::env::args().nth(1).as_deref() == Some("town") {
        return time_in_town();
    }
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
