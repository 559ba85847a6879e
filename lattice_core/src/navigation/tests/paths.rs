//! Paths on the ground in worlds whose truth is known.

use super::*;

/// Path between positions of a world, in the world.
fn path(
    mapped: &Mapped,
    [start, goal]: [[f64; 3]; 2],
    robot_radius_m: f64,
) -> Result<GroundPath, GroundPathError> {
    let at_m = |at: [f64; 3]| (mapped.map_from_world * nalgebra::Point3::from(at)).coords;
    let ground = mapped.projector(options()).ground_map()?;
    let options = GroundPathOptions {
        robot_radius_m,
        ..GroundPathOptions::default()
    };
    let mut path = ground.path(&at_m(start), &at_m(goal), &options)?;
    let world_from_map = mapped.map_from_world.inverse();
    for at_m in path.points_m.iter_mut().chain(&mut path.corners_m) {
        *at_m = (world_from_map * nalgebra::Point3::from(*at_m)).coords;
    }
    Ok(path)
}

fn expect_start_outside(error: &GroundPathError) {
    let end = PathEnd::Start;
    assert!(
        matches!(error, GroundPathError::Outside { end: found, .. } if *found == end),
        "{error}"
    );
}

#[test]
fn a_path_goes_through_the_door_that_is_wide_enough() {
    let z = [0.0, 1.0];
    let world = World::default()
        .floor([0.0, 0.0], [8.0, 8.0], 0.0)
        .wall([4.0, 0.0], [4.0, 2.0], z)
        .wall([4.0, 3.2], [4.0, 5.0], z)
        .wall([4.0, 7.0], [4.0, 8.0], z);
    let ends = [[1.0, 2.5, 0.2], [7.0, 2.5, 0.2]];
    for kind in KINDS {
        for seed in 0..SEEDS {
            let mapped = Mapped::new(&world, kind, 0.1, seed);
            for (radius_m, door) in [(0.25, [2.0, 3.2]), (0.6, [5.0, 7.0])] {
                let path = path(&mapped, ends, radius_m).unwrap();
                let walls = [[0.0, 2.0], [3.2, 5.0], [7.0, 8.0]];
                let away_m = |p: &Vector3<f64>, [low, high]: [f64; 2]| {
                    (p.x - 4.0).hypot(p.y - p.y.clamp(low, high))
                };
                for p in &path.points_m {
                    let room_m = walls
                        .map(|wall| away_m(p, wall))
                        .into_iter()
                        .fold(9.0, f64::min);
                    assert!(
                        room_m >= radius_m,
                        "{kind} {seed}: {p}, {room_m} m of {radius_m}"
                    );
                }
                let wall_m = |p: &Vector3<f64>| (p.x - 4.0).abs();
                assert!(path.points_m.iter().any(|p| wall_m(p) < 0.1));
                // Not much longer than by way of the posts.
                let turn_m = (f64::max(door[0], 2.5) - 2.5) + radius_m;
                let bent_m = 2.0 * 3.0_f64.hypot(turn_m);
                assert!(path.length_m < bent_m + 0.9, "{} m", path.length_m);
            }
            let robot = mapped.map_from_world * nalgebra::Point3::from(ends[0]);
            let grid = mapped
                .projector(options())
                .grid(Some(robot.coords), None)
                .unwrap();
            for p in path(&mapped, ends, 0.25).unwrap().points_m {
                let p = mapped.map_from_world * nalgebra::Point3::from(p);
                assert_eq!(grid.at_m(p.x, p.y), Cell::Free, "{kind} {seed}: {p}");
            }
            let error = path(&mapped, ends, 1.1).unwrap_err();
            assert!(matches!(error, GroundPathError::NoWay { .. }), "{error}");
        }
    }
}

#[test]
fn a_path_to_the_upper_floor_takes_the_ramp() {
    let top_m = 11.0 * 15.0_f64.to_radians().tan();
    // The ground below the ramp was never seen.
    let world = World::default()
        .floor([0.0, 0.0], [3.0, 8.0], 0.0)
        .floor([3.0, 3.0], [14.0, 8.0], 0.0)
        .floor([14.0, 0.0], [20.0, 8.0], 0.0)
        .patch([3.0, 0.0, 0.0], [11.0, 0.0, top_m], [0.0, 3.0, 0.0])
        .floor([14.0, 0.0], [20.0, 8.0], top_m);
    for kind in KINDS {
        for seed in 0..SEEDS {
            let mapped = Mapped::new(&world, kind, 0.1, seed);
            let lower = [1.0, 6.0, 0.2];
            let up = path(&mapped, [lower, [18.0, 6.0, top_m + 0.2]], 0.3).unwrap();
            let on_ramp = up
                .points_m
                .iter()
                .filter(|p| (0.5..top_m - 0.5).contains(&p.z));
            let on_ramp: Vec<_> = on_ramp.collect();
            assert!(on_ramp.len() > 50, "{kind} {seed}: {}", on_ramp.len());
            assert!(on_ramp.iter().all(|p| (0.3..2.7).contains(&p.y)));
            let rise = 15.0_f64.to_radians().tan();
            assert!(
                on_ramp
                    .iter()
                    .all(|p| (p.z - rise * (p.x - 3.0)).abs() < 0.05)
            );
            let above = |p: &Vector3<f64>| p.z > top_m - 0.2;
            let off_edge =
                |p: &&Vector3<f64>| (p.x - 14.0).max(0.0).hypot((3.0 - p.y).max(0.0)) >= 0.3;
            let above: Vec<_> = up.points_m.iter().filter(|p| above(p)).collect();
            assert!(
                above.len() > 20 && above.iter().all(off_edge),
                "{kind} {seed}: {above:?}"
            );
            let last = up.points_m.last().unwrap();
            assert!(
                (last - Vector3::new(18.0, 6.0, top_m)).norm() < 0.15,
                "{last}"
            );
            // Back, and to the place below.
            let down = path(&mapped, [[18.0, 6.0, top_m + 0.2], lower], 0.3).unwrap();
            assert!((down.length_m - up.length_m).abs() < 0.05 * up.length_m);
            let below = path(&mapped, [lower, [18.0, 6.0, 0.2]], 0.3).unwrap();
            assert!(below.points_m.iter().all(|p| p.z < 0.1));
            assert!((below.length_m - 17.0).abs() < 0.2, "{}", below.length_m);
        }
    }
}

#[test]
fn ends_without_ground_room_or_way_are_refused() {
    // An island, a crate on it, and a plateau that no ramp leads to.
    let world = World::default()
        .floor([0.0, 0.0], [6.0, 6.0], 0.0)
        .solid([2.0, 2.0, 0.0], [3.0, 3.0, 0.8])
        .wall([6.0, 0.0], [6.0, 6.0], [0.0, 1.0])
        .floor([6.0, 0.0], [12.0, 6.0], 1.0);
    let mapped = Mapped::new(&world, LatticeKind::Fcc, 0.1, 1);
    let from = [1.0, 1.0, 0.1];
    let refused = |ends, radius_m| path(&mapped, ends, radius_m).unwrap_err();
    let error = refused([from, [50.0, 50.0, 0.0]], 0.3);
    assert!(
        matches!(
            error,
            GroundPathError::Outside {
                end: PathEnd::Goal,
                ..
            }
        ),
        "{error}"
    );
    let error = refused([[f64::NAN; 3], from], 0.3);
    expect_start_outside(&error);
    let error = refused([[6.0, -0.9, 0.1], from], 0.0);
    assert!(matches!(
        error,
        GroundPathError::Outside { .. } | GroundPathError::NoGround { .. }
    ));
    for (goal, radius_m) in [([2.5, 2.5, 0.1], 0.1), ([3.3, 2.5, 0.1], 0.9)] {
        let error = refused([from, goal], radius_m);
        let is_named = match goal[0] < 3.0 {
            true => matches!(
                error,
                GroundPathError::NoGround {
                    end: PathEnd::Goal,
                    ..
                }
            ),
            false => matches!(
                error,
                GroundPathError::NoRoom {
                    end: PathEnd::Goal,
                    ..
                }
            ),
        };
        assert!(is_named, "{error}");
    }
    let error = refused([from, [9.0, 3.0, 1.1]], 0.3);
    assert_eq!(error, GroundPathError::NoWay { expanded: 0 });
    for radius_m in [-0.1, 9.0, f64::NAN] {
        let error = refused([from, [5.0, 5.0, 0.1]], radius_m).to_string();
        assert!(error.contains("`robot_radius_m`"), "{error}");
    }
    // A goal of RViz has the height 0, and here the ground is above it.
    let low = path(&mapped, [from, [5.0, 5.0, -3.0]], 0.3).unwrap();
    assert!(low.points_m.last().unwrap().z.abs() < 0.05);
    // A crate is nothing to stand on: the goal moves off it, up to the tolerance.
    let beside = path(&mapped, [from, [2.05, 2.5, 0.9]], 0.2).unwrap();
    let last = beside.points_m.last().unwrap();
    assert!(last.x < 1.85 && last.z.abs() < 0.05, "{last}");
}

#[test]
fn a_search_is_bounded_and_can_be_stopped() {
    let world = World::default().floor([0.0, 0.0], [6.0, 6.0], 0.0);
    let mapped = Mapped::new(&world, LatticeKind::Cubic, 0.1, 1);
    let at_m = |at: [f64; 3]| (mapped.map_from_world * nalgebra::Point3::from(at)).coords;
    let mut projector = mapped.projector(options());
    let ground = projector.ground_map().unwrap();
    let [start_m, goal_m] = [[1.0, 1.0, 0.1], [5.0, 4.0, 0.1]].map(at_m);
    let few = GroundPathOptions {
        max_expanded: 10,
        ..GroundPathOptions::default()
    };
    let found = ground.path(&start_m, &goal_m, &few);
    assert_eq!(found, Err(GroundPathError::Limit { expanded: 10 }));
    let all = GroundPathOptions::default();
    let mut calls = 0;
    let whole = ground.path_while(&start_m, &goal_m, &all, || {
        calls += 1;
        true
    });
    assert_eq!(
        whole.as_ref().unwrap(),
        &ground.path(&start_m, &goal_m, &all).unwrap()
    );
    // Wherever it is stopped, it ends with the same error at that call.
    for stop in (1..calls).step_by(17) {
        let mut count = 0;
        let stopped = ground.path_while(&start_m, &goal_m, &all, || {
            count += 1;
            count < stop
        });
        assert!(
            matches!(stopped, Err(GroundPathError::Limit { .. })),
            "{stop} of {calls}"
        );
        assert_eq!(count, stop);
    }
    let flat = ProjectorOptions {
        rule: ProjectionRule::Flat {
            min_z_m: 0.0,
            max_z_m: 1.0,
        },
        ..options()
    };
    let error = mapped.projector(flat).ground_map().unwrap_err();
    assert_eq!(error, GroundPathError::FlatRule);
    // Without a voxel there is no place.
    let lattice = Lattice::new(LatticeKind::Cubic, 0.001).unwrap();
    let mut empty = Projector::new(&lattice, Vector3::zeros(), options()).unwrap();
    let error = empty
        .ground_map()
        .unwrap()
        .path(&start_m, &goal_m, &all)
        .unwrap_err();
    expect_start_outside(&error);
}
