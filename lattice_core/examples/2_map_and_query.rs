//! Maps clouds of a yard with a wall, asks for the nearest voxel and for free space, and plans a path around the wall.
//!
//! `cargo run --release -p lattice_core --example 2_map_and_query`

use std::error::Error;

use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::nalgebra::Vector3;
use lattice_core::query::{Bounds, PathOptions, Query, Segment, Steps};
use lattice_core::voxels::VoxelList;

/// A plane patch from `corner`, spanned by two edges, with a point each 5 cm.
fn patch(corner: [f64; 3], u: [f64; 3], v: [f64; 3]) -> Vec<Vector3<f64>> {
    let [corner, u, v] = [corner, u, v].map(Vector3::from);
    let steps = |edge: &Vector3<f64>| (edge.norm() / 0.05) as i32;
    let rows = 0..=steps(&u);
    let point =
        |i, j| corner + u.normalize() * 0.05 * f64::from(i) + v.normalize() * 0.05 * f64::from(j);
    rows.flat_map(|i| (0..=steps(&v)).map(move |j| point(i, j)))
        .collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    // A map of cells as large as cubes of 0.2 m, with at most a million voxels.
    let lattice = Lattice::new(LatticeKind::Fcc, 0.2_f64.powi(3))?;
    let mut map = VoxelList::new(lattice, Vector3::zeros(), 1_000_000)?;
    let ground = patch([-5.0, -5.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0]);
    let wall = patch([0.0, -3.0, 0.0], [0.0, 6.0, 0.0], [0.0, 0.0, 2.0]);
    for points_m in [ground, wall] {
        let report = map.insert(&Cloud::from_points(0, Vector3::zeros(), &points_m));
        println!(
            "{} points in {} new voxels",
            report.inserted, report.new_voxels
        );
        assert_eq!(report.inserted, report.points);
    }

    // The occupied voxel that is nearest to a point.
    let query = Query::new(&map);
    let (from_m, to_m) = (Vector3::new(-2.0, 0.0, 1.0), Vector3::new(2.0, 0.0, 1.0));
    let nearest = query.nearest(&from_m, 1)?;
    let nearest = nearest.first().ok_or("the map is empty")?;
    println!(
        "nearest voxel of {:?}: {:.2} m",
        from_m.as_slice(),
        nearest.distance_m
    );
    assert!((nearest.distance_m - 1.0).abs() < 0.2);

    // A robot of 0.3 m radius does not pass the wall, and there is a path around it.
    let straight = Segment { from_m, to_m };
    assert!(!query.is_free(&straight, 0.3)?);
    let options = PathOptions {
        radius_m: 0.3,
        steps: Steps::Touching,
        bounds: Some(Bounds {
            min_m: Vector3::new(-5.0, -5.0, 0.0),
            max_m: Vector3::new(5.0, 5.0, 1.5),
        }),
        max_expanded: 100_000,
    };
    let path = query.shortest_path(&from_m, &to_m, &options)?;
    println!("path around the wall: {:.1} m", path.length_m);
    assert!(path.length_m > 2.0 * 2.0_f64.hypot(3.0));
    Ok(())
}
