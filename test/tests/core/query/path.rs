//! Shortest paths.

use std::collections::{BTreeMap, BTreeSet};

use lattice_core::lattice::{LatticeKind, MortonKey};
use lattice_core::query::{Bounds, Path, PathError, PathOptions, Query, Segment, Steps};
use lattice_core::voxels::{VoxelList, VoxelStore};
use nalgebra::Vector3;
use proptest::prelude::*;

use super::worlds::World;

/// A box of 3 m with obstacles in it.
fn any_obstacles() -> impl Strategy<Value = World> {
    let kind = prop::sample::select(&LatticeKind::ALL[..]);
    let point = prop::array::uniform3(-1.5..1.5_f64).prop_map(Vector3::from);
    let datum = prop_oneof![
        Just(Vector3::zeros()),
        Just(Vector3::new(4.4e5, -5.5e6, 120.0))
    ];
    (kind, datum, prop::collection::vec(point, 0..50)).prop_map(|(kind, datum_m, offsets_m)| {
        World {
            kind,
            cell_volume_m3: 0.05,
            datum_m,
            offsets_m,
        }
    })
}

fn around(world: &World) -> Bounds {
    Bounds {
        min_m: world.datum_m - Vector3::repeat(1.5),
        max_m: world.datum_m + Vector3::repeat(1.5),
    }
}

/// Length of the shortest path by relaxing every step until nothing changes, with the clearance of
/// points and lines for each cell and step.
fn shortest_by_relaxation(
    voxels: &VoxelList,
    start: MortonKey,
    goal: MortonKey,
    options: &PathOptions,
) -> Option<f64> {
    let query = Query::new(voxels);
    let lattice = voxels.lattice();
    let (datum, bounds) = (voxels.datum_m(), options.bounds.unwrap());
    let center = |key: MortonKey| datum + lattice.center(key.unpack());
    let radius = options.radius_m + 1e-8;
    let mut open = BTreeSet::new();
    for (x, y, z) in (0..41 * 41 * 41).map(|i| (i % 41 - 20, i / 41 % 41 - 20, i / 1681 - 20)) {
        let key = MortonKey::pack([x, y, z]).unwrap();
        if bounds.contains(&center(key))
            && query.is_free(&Segment::point(center(key)), radius).unwrap()
        {
            open.insert(key);
        }
    }
    let steps = match options.steps {
        Steps::Face => lattice.face_neighbors(),
        Steps::Touching => lattice.touching_neighbors(),
    };
    let mut edges = Vec::new();
    for &from in &open {
        for by in steps {
            let w = from.unpack();
            let to = MortonKey::pack([w[0] + by[0], w[1] + by[1], w[2] + by[2]]).unwrap();
            let line = Segment {
                from_m: center(from),
                to_m: center(to),
            };
            if open.contains(&to) && query.is_free(&line, radius).unwrap() {
                edges.push((from, to, lattice.center(*by).norm()));
            }
        }
    }
    let mut length = BTreeMap::from([(start, 0.0)]);
    loop {
        let mut changed = false;
        for &(from, to, step) in &edges {
            if let Some(reached) = length.get(&from).map(|l| l + step) {
                let known = length.get(&to).copied().unwrap_or(f64::INFINITY);
                if reached < known - 1e-9 {
                    length.insert(to, reached);
                    changed = true;
                }
            }
        }
        if !changed {
            return length.get(&goal).copied();
        }
    }
}

/// A path is what it says it is.
fn check(query: &Query<'_, VoxelList>, path: &Path, options: &PathOptions) {
    assert_eq!(path.keys.len(), path.centers_m.len());
    let length: f64 = path
        .centers_m
        .windows(2)
        .map(|p| (p[1] - p[0]).norm())
        .sum();
    assert!((length - path.length_m).abs() < 1e-6);
    for (key, center) in path.keys.iter().zip(&path.centers_m) {
        assert_eq!(query.store().key_of(center), Some(*key));
        assert!(options.bounds.is_none_or(|b| b.contains(center)));
    }
    let radius_m = (options.radius_m - 1e-8).max(0.0);
    assert!(is_clear(query, &path.centers_m, radius_m));
}

/// True if a ball that moves along the points touches no occupied cell.
fn is_clear(query: &Query<'_, VoxelList>, path_m: &[Vector3<f64>], radius_m: f64) -> bool {
    path_m
        .iter()
        .zip(path_m.iter().skip(1).chain(path_m.last()))
        .all(|(&from_m, &to_m)| query.is_free(&Segment { from_m, to_m }, radius_m).unwrap())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn paths_are_as_short_as_relaxation_finds(
        world in any_obstacles(),
        radius_m in prop_oneof![Just(0.0), 0.0..0.5],
        steps in prop::sample::select(vec![Steps::Face, Steps::Touching]),
    ) {
        let voxels = world.voxels();
        let query = Query::new(&voxels);
        // Far from the bounds to the last bit, so that rounding in the map frame does not count.
        let mut bounds = around(&world);
        bounds.min_m -= Vector3::repeat(1e-3);
        bounds.max_m += Vector3::new(1.3e-3, 1.7e-3, 0.9e-3);
        let options = PathOptions { radius_m, steps, bounds: Some(bounds), max_expanded: 100_000 };
        let start = world.datum_m + Vector3::new(-1.1, -1.0, -1.2);
        let goal = world.datum_m + Vector3::new(1.1, 1.2, 1.0);
        let found = query.shortest_path(&start, &goal, &options);
        let ends = [start, goal].map(|p| voxels.key_of(&p).unwrap());
        match found {
            Err(PathError::Blocked { end, .. }) => {
                let key = if end == "start" { ends[0] } else { ends[1] };
                let center = VoxelStore::center_m(&voxels, key);
                prop_assert!(!query.is_free(&Segment::point(center), radius_m + 1e-8).unwrap());
            }
            Err(PathError::NoPath { .. }) => {
                let expected = shortest_by_relaxation(&voxels, ends[0], ends[1], &options);
                prop_assert_eq!(expected, None);
            }
            Err(other) => prop_assert!(false, "{other}"),
            Ok(path) => {
                check(&query, &path, &options);
                let expected = shortest_by_relaxation(&voxels, ends[0], ends[1], &options);
                let length = expected.unwrap();
                prop_assert!((path.length_m - length).abs() < 1e-7, "{} {length}", path.length_m);
                let short = query.shorten(&path.centers_m, radius_m).unwrap();
                let length: f64 = short.windows(2).map(|p| (p[1] - p[0]).norm()).sum();
                prop_assert!(length <= path.length_m + 1e-9);
                prop_assert_eq!(short.first(), path.centers_m.first());
                prop_assert_eq!(short.last(), path.centers_m.last());
                prop_assert!(is_clear(&query, &short, (radius_m - 1e-7).max(0.0)));
                let again = query.shortest_path(&start, &goal, &options);
                prop_assert_eq!(again, Ok(path));
            }
        }
    }

    #[test]
    fn straight_paths_are_free_and_hardly_longer(
        world in any_obstacles(),
        radius_m in prop_oneof![Just(0.0), 0.0..0.5],
        cells_per_radius in 1.0..9.0_f64,
    ) {
        let mut world = world;
        world.cell_volume_m3 = (f64::max(radius_m, 0.3) / cells_per_radius).powi(3);
        let voxels = world.voxels();
        let query = Query::new(&voxels);
        let bounds = Some(around(&world));
        let steps = Steps::Touching;
        let options = PathOptions { radius_m, steps, bounds, max_expanded: 1_000_000 };
        let start = world.datum_m + Vector3::new(-1.1, -1.0, -1.2);
        let goal = world.datum_m + Vector3::new(1.1, 1.2, 1.0);
        let straight = query.straight_path(&start, &goal, &options);
        let shortest = query.shortest_path(&start, &goal, &options);
        match (straight, shortest) {
            (Ok(straight), Ok(shortest)) => {
                check(&query, &straight, &options);
                for (key, end) in [(straight.keys.first(), start), (straight.keys.last(), goal)] {
                    prop_assert_eq!(key.copied(), voxels.key_of(&end));
                }
                let crow_m = (straight.centers_m[0] - straight.centers_m.last().unwrap()).norm();
                prop_assert!(straight.length_m > crow_m - 1e-9);
                // Long steps may go round another side of an obstacle, at most a metre across here.
                prop_assert!(straight.length_m < 1.05 * shortest.length_m + 1.0);
            }
            (Err(straight), Err(shortest)) => {
                prop_assert_eq!(std::mem::discriminant(&straight), std::mem::discriminant(&shortest));
            }
            (straight, shortest) => prop_assert!(false, "{:?} {:?}", straight, shortest),
        }
    }

    #[test]
    fn larger_robots_and_fewer_steps_never_find_shorter_paths(world in any_obstacles()) {
        let voxels = world.voxels();
        let query = Query::new(&voxels);
        let start = world.datum_m + Vector3::new(-1.1, -1.0, -1.2);
        let goal = world.datum_m + Vector3::new(1.1, 1.2, 1.0);
        let length = |radius_m: f64, steps: Steps| {
            let bounds = Some(around(&world));
            let options = PathOptions { radius_m, steps, bounds, max_expanded: 100_000 };
            let path = query.shortest_path(&start, &goal, &options);
            path.map_or(f64::INFINITY, |path| path.length_m)
        };
        let mut last = 0.0;
        for radius_m in [0.0, 0.1, 0.2, 0.3, 0.5] {
            let face = length(radius_m, Steps::Face);
            prop_assert!(face >= last - 1e-9);
            prop_assert!(length(radius_m, Steps::Touching) <= face + 1e-9);
            last = face;
        }
    }
}

fn wall_with_a_gap(kind: LatticeKind, gap_m: f64) -> World {
    let mut offsets_m = Vec::new();
    for i in -40..=40 {
        for j in -40..=40 {
            let (y, z) = (f64::from(i) * 0.1, f64::from(j) * 0.1);
            if (y - 1.0).abs() > gap_m || z.abs() > gap_m {
                offsets_m.push(Vector3::new(0.0, y, z));
            }
        }
    }
    World {
        kind,
        cell_volume_m3: 0.008,
        datum_m: Vector3::zeros(),
        offsets_m,
    }
}

#[test]
fn a_gap_lets_through_what_fits_and_nothing_else() {
    for kind in LatticeKind::ALL {
        let world = wall_with_a_gap(kind, 0.8);
        let voxels = world.voxels();
        let query = Query::new(&voxels);
        let bounds = Some(Bounds {
            min_m: Vector3::repeat(-3.5),
            max_m: Vector3::repeat(3.5),
        });
        let (start, goal) = (Vector3::new(-2.0, -1.0, 0.0), Vector3::new(2.0, -1.0, 0.0));
        let find = |radius_m: f64| {
            let options = PathOptions {
                radius_m,
                steps: Steps::Face,
                bounds,
                max_expanded: 200_000,
            };
            query.shortest_path(&start, &goal, &options)
        };
        let path = find(0.3).unwrap();
        assert!(path.length_m > 4.4, "{kind} {}", path.length_m);
        let crossing = path
            .centers_m
            .iter()
            .min_by(|a, b| a.x.abs().total_cmp(&b.x.abs()));
        let crossing = crossing.unwrap();
        assert!(
            (crossing.y - 1.0).abs() < 0.6 && crossing.z.abs() < 0.6,
            "{kind} {crossing}"
        );
        assert!(matches!(find(0.9), Err(PathError::NoPath { .. })), "{kind}");
    }
}

#[test]
fn limits_are_obeyed_and_errors_say_what() {
    let voxels = wall_with_a_gap(LatticeKind::Bcc, 0.8).voxels();
    let query = Query::new(&voxels);
    let options = PathOptions {
        radius_m: 0.1,
        steps: Steps::Face,
        bounds: None,
        max_expanded: 50_000,
    };
    let (start, goal) = (Vector3::new(-2.0, 1.0, 0.0), Vector3::new(2.0, 1.0, 0.0));
    let find = |options: &PathOptions| query.shortest_path(&start, &goal, options);
    assert!(find(&options).is_ok());
    let limited = find(&PathOptions {
        max_expanded: 3,
        ..options
    });
    assert_eq!(limited, Err(PathError::Limit { expanded: 3 }));
    let bounds = Some(Bounds {
        min_m: start,
        max_m: start + Vector3::repeat(1.0),
    });
    let outside = find(&PathOptions { bounds, ..options });
    assert!(matches!(outside, Err(PathError::OutOfBounds { .. })));
    let wall = Vector3::new(0.0, -2.0, 0.0);
    let error = query.shortest_path(&start, &wall, &options).unwrap_err();
    assert!(error.to_string().contains("goal") && error.to_string().contains("0.1 m"));
    for bad in [f64::NAN, -1.0] {
        assert!(matches!(
            find(&PathOptions {
                radius_m: bad,
                ..options
            }),
            Err(PathError::Query(_))
        ));
    }
    for huge in [100.0, 1e12, f64::INFINITY] {
        let error = find(&PathOptions {
            radius_m: huge,
            ..options
        });
        assert!(matches!(error, Err(PathError::Radius { .. })));
    }
    let nowhere = Vector3::new(f64::NAN, 0.0, 0.0);
    assert!(query.shortest_path(&nowhere, &goal, &options).is_err());
    let far = Vector3::new(1e9, 0.0, 0.0);
    let error = query.shortest_path(&start, &far, &options);
    assert!(matches!(
        error,
        Err(PathError::OutOfBounds { end: "goal", .. })
    ));
    let same = query.shortest_path(&start, &start, &options).unwrap();
    assert_eq!((same.keys.len(), same.length_m, same.expanded), (1, 0.0, 0));
    assert_eq!(query.shorten(&same.centers_m, 0.1).unwrap(), same.centers_m);
}
