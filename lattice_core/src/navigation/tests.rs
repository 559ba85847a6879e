use nalgebra::Vector3;

use self::world::{Mapped, Score, Truth, World};
use super::*;
use crate::lattice::LatticeKind;

mod brute_paths;
mod changes;
mod elevation;
mod paths;
mod steps;
mod tiles;
mod work;
mod world;

const SEEDS: u64 = 4;
const KINDS: [LatticeKind; 2] = [LatticeKind::Cubic, LatticeKind::Fcc];

fn options() -> ProjectorOptions {
    ProjectorOptions::default()
}

/// Scores a world on several lattices and places.
fn judge(
    name: &str,
    side_m: f64,
    world: &World,
    robot: [f64; 3],
    truth: impl Fn(f64, f64) -> Truth + Copy,
) {
    for kind in KINDS {
        let mut score = Score::default();
        for seed in 0..SEEDS {
            let mapped = Mapped::new(world, kind, side_m, seed);
            let grid = mapped.grid(options(), robot);
            score += mapped.score(&grid, truth);
        }
        score.check(&format!("{name} on {kind}"));
    }
}

fn inside(x: f64, y: f64, low: [f64; 2], high: [f64; 2]) -> bool {
    low[0] <= x && x <= high[0] && low[1] <= y && y <= high[1]
}

#[test]
fn a_room_with_a_door() {
    let z = [0.0, 2.4];
    let room = World::default()
        .floor([0.0, 0.0], [8.0, 5.0], 0.0)
        .floor([0.0, 0.0], [8.0, 5.0], 2.4)
        .wall([0.0, 0.0], [8.0, 0.0], z)
        .wall([8.0, 0.0], [8.0, 5.0], z)
        .wall([8.0, 5.0], [0.0, 5.0], z)
        .wall([0.0, 5.0], [0.0, 0.0], z)
        .solid([3.9, 0.0, 0.0], [4.1, 2.0, 2.4])
        .solid([3.9, 3.0, 0.0], [4.1, 5.0, 2.4])
        .solid([3.9, 2.0, 2.0], [4.1, 3.0, 2.4]);
    let truth = |x: f64, y: f64| {
        let in_wall = inside(x, y, [3.9, 0.0], [4.1, 5.0]) && !(2.0..=3.0).contains(&y);
        match in_wall {
            true => Truth::Obstacle,
            false if inside(x, y, [0.0, 0.0], [8.0, 5.0]) => Truth::Free,
            false => Truth::Obstacle,
        }
    };
    judge("room", 0.1, &room, [1.0, 1.0, 0.2], truth);
    judge("room, fine", 0.05, &room, [1.0, 1.0, 0.2], truth);
}

#[test]
fn curbs_up_to_the_limit() {
    for curb_m in [0.05, 0.15, 0.2, 0.25, 0.3] {
        let world = World::default()
            .floor([0.0, 0.0], [4.0, 5.0], 0.0)
            .wall([4.0, 0.0], [4.0, 5.0], [0.0, curb_m])
            .floor([4.0, 0.0], [8.0, 5.0], curb_m);
        let truth = |x: f64, y: f64| match inside(x, y, [0.0, 0.0], [8.0, 5.0]) {
            false => Truth::Open,
            true if curb_m < 0.1 => Truth::Free,
            true if (3.988..4.012).contains(&x) => Truth::Obstacle,
            true if x > 4.0 => Truth::Open,
            true => Truth::Free,
        };
        judge(
            &format!("curb {curb_m}"),
            0.1,
            &world,
            [1.0, 1.0, 0.2],
            truth,
        );
    }
}

#[test]
fn ramps_up_to_the_limit() {
    for slope_deg in [5.0_f64, 10.0, 15.0, 25.0, 30.0] {
        let rise = slope_deg.to_radians().tan();
        let top_m = 4.0 * rise;
        let world = World::default()
            .floor([0.0, 0.0], [4.0, 5.0], 0.0)
            .patch([4.0, 0.0, 0.0], [4.0, 0.0, top_m], [0.0, 5.0, 0.0])
            .floor([8.0, 0.0], [12.0, 5.0], top_m);
        let truth = |x: f64, y: f64| match inside(x, y, [0.0, 0.0], [12.0, 5.0]) {
            false => Truth::Open,
            true if slope_deg < 20.0 || x < 3.9 => Truth::Free,
            // The first and the last cells of a steep ramp are those of its ends.
            true if (4.3..7.7).contains(&x) => Truth::Obstacle,
            true => Truth::Open,
        };
        judge(
            &format!("ramp {slope_deg}"),
            0.1,
            &world,
            [1.0, 1.0, 0.2],
            truth,
        );
    }
}

#[test]
fn a_bridge_over_a_road_by_the_height_of_the_robot() {
    let world = World::default()
        .floor([0.0, 0.0], [12.0, 4.0], 0.0)
        .solid([5.0, -3.0, 2.6], [7.0, 7.0, 3.0])
        .floor([4.0, -9.0], [8.0, -3.0], 3.0)
        .solid([5.0, -0.3, 0.0], [7.0, 0.0, 2.6])
        .solid([5.0, 4.0, 0.0], [7.0, 4.3, 2.6]);
    let road = |x: f64, y: f64| match inside(x, y, [0.0, 0.0], [12.0, 4.0]) {
        true => Truth::Free,
        false if inside(x, y, [5.0, -0.3], [7.0, 4.3]) => Truth::Obstacle,
        false => Truth::Open,
    };
    judge("road", 0.1, &world, [1.0, 1.0, 0.2], road);
    let deck = |x: f64, y: f64| match inside(x, y, [5.0, -3.0], [7.0, 7.0]) {
        true => Truth::Free,
        false if inside(x, y, [4.0, -9.0], [8.0, -3.0]) => Truth::Free,
        // As far as the sides of the deck were seen.
        false if inside(x, y, [4.9, -2.8], [7.1, 6.9]) => Truth::Obstacle,
        false => Truth::Open,
    };
    judge("deck", 0.1, &world, [6.0, -6.0, 3.2], deck);
}

#[test]
fn ditches_with_and_without_a_bottom() {
    for bottom_seen in [true, false] {
        let mut world =
            World::default()
                .floor([0.0, 0.0], [4.0, 5.0], 0.0)
                .floor([4.8, 0.0], [9.0, 5.0], 0.0);
        if bottom_seen {
            world = world
                .floor([4.0, 0.0], [4.8, 5.0], -0.6)
                .wall([4.0, 0.0], [4.0, 5.0], [-0.6, 0.0])
                .wall([4.8, 0.0], [4.8, 5.0], [-0.6, 0.0]);
        }
        let truth = |x: f64, y: f64| match inside(x, y, [0.0, 0.0], [9.0, 5.0]) {
            false => Truth::Open,
            true if x < 3.999 => Truth::Free,
            true if x < 4.8 => Truth::Obstacle,
            true => Truth::Open,
        };
        // A cell at the edge of ground whose bottom was never seen is ground as far as it was seen.
        let deep = |x: f64, y: f64| match truth(x, y) {
            Truth::Obstacle if !bottom_seen && !(4.1..4.7).contains(&x) => Truth::Open,
            truth => truth,
        };
        judge(
            &format!("ditch, bottom seen {bottom_seen}"),
            0.1,
            &world,
            [1.0, 1.0, 0.2],
            deep,
        );
    }
}

#[test]
fn a_dock_whose_side_was_never_seen_is_an_obstacle_in_between() {
    let world =
        World::default()
            .floor([0.0, 0.0], [5.0, 5.0], 1.2)
            .floor([6.0, 0.0], [11.0, 5.0], 0.0);
    for kind in KINDS {
        for seed in 0..SEEDS {
            let mapped = Mapped::new(&world, kind, 0.1, seed);
            let grid = mapped.grid(options(), [1.0, 1.0, 1.4]);
            let score = mapped.score(&grid, |x, y| match inside(x, y, [0.3, 0.3], [10.7, 4.7]) {
                true if x > 5.1 => Truth::Obstacle,
                true if x < 5.0 => Truth::Free,
                _ => Truth::Open,
            });
            assert_eq!(score.called_free, 0);
            let occupied = |x: f64| {
                let p = mapped.map_from_world * nalgebra::Point3::new(x, 2.5, 0.0);
                grid.at_m(p.x, p.y) == Cell::Occupied
            };
            assert!(occupied(5.5) && occupied(5.3), "between dock and yard");
        }
    }
}

#[test]
fn tables_beams_and_what_is_above_the_robot() {
    let world = World::default()
        .floor([0.0, 0.0], [10.0, 5.0], 0.0)
        .solid([2.0, 1.0, 0.7], [3.0, 3.0, 0.75])
        .solid([5.0, 0.0, 1.2], [5.2, 5.0, 1.4])
        .solid([4.0, 0.0, 1.75], [4.2, 5.0, 2.0]);
    let truth = |x: f64, y: f64| match inside(x, y, [0.0, 0.0], [10.0, 5.0]) {
        false => Truth::Open,
        true if inside(x, y, [2.0, 1.0], [3.0, 3.0]) => Truth::Obstacle,
        true if (5.0..=5.2).contains(&x) => Truth::Obstacle,
        true if x > 5.2 => Truth::Open,
        true => Truth::Free,
    };
    judge("table and beams", 0.1, &world, [1.0, 1.0, 0.2], truth);
}

#[test]
fn two_floors_with_a_ramp_between() {
    // From the ground in the west up to a floor over the east.
    let rise = 15.0_f64.to_radians().tan();
    let top_m = 11.0 * rise;
    let world = World::default()
        .floor([0.0, 0.0], [20.0, 8.0], 0.0)
        .patch([3.0, 0.0, 0.0], [11.0, 0.0, top_m], [0.0, 3.0, 0.0])
        .floor([14.0, 0.0], [20.0, 8.0], top_m);
    let below = |x: f64, y: f64| match inside(x, y, [0.0, 0.0], [20.0, 8.0]) {
        false => Truth::Open,
        true if y > 3.0 => Truth::Free,
        _ => Truth::Open,
    };
    judge("lower floor", 0.1, &world, [1.0, 6.0, 0.2], below);
    let above = |x: f64, y: f64| match inside(x, y, [0.0, 0.0], [20.0, 8.0]) {
        false => Truth::Open,
        true if x > 14.0 || x > 10.0 && y < 2.999 => Truth::Free,
        true => Truth::Open,
    };
    judge("upper floor", 0.1, &world, [18.0, 6.0, top_m + 0.2], above);
    for kind in KINDS {
        for seed in 0..SEEDS {
            let mapped = Mapped::new(&world, kind, 0.1, seed);
            let grid = mapped.grid(options(), [18.0, 6.0, top_m + 0.2]);
            // Not over the edge of the upper floor: only by way of the ramp.
            let reached = mapped.flood(&grid, [18.0, 6.0], |_, y| y > 3.2);
            assert!(reached.iter().all(|at| at[0] > 13.8), "{kind}, seed {seed}");
            assert!(reached.len() > 2000, "{}", reached.len());
        }
    }
}

#[test]
fn what_was_never_seen_is_unknown() {
    let world =
        World::default()
            .floor([0.0, 0.0], [3.0, 3.0], 0.0)
            .floor([3.5, 0.0], [6.0, 3.0], 0.0);
    let mapped = Mapped::new(&world, LatticeKind::Fcc, 0.1, 1);
    let grid = mapped.grid(options(), [1.0, 1.0, 0.2]);
    let at = |x: f64| {
        let p = mapped.map_from_world * nalgebra::Point3::new(x, 1.5, 0.0);
        grid.at_m(p.x, p.y)
    };
    assert_eq!(
        [1.5, 3.25, 5.0].map(at),
        [Cell::Free, Cell::Unknown, Cell::Unknown]
    );
    assert_eq!(grid.count(Cell::Occupied), 0);
    assert_eq!(grid.at_m(1e9, -1e9), Cell::Unknown);
}

#[test]
fn ground_that_was_not_seen_below_a_ceiling_is_unknown() {
    let world = World::default()
        .floor([0.0, 0.0], [6.0, 1.0], 0.0)
        .floor([0.0, 1.0], [2.0, 3.0], 0.0)
        .floor([3.0, 1.0], [6.0, 3.0], 0.0)
        .floor([0.0, 3.0], [6.0, 4.0], 0.0)
        .floor([0.0, 0.0], [6.0, 4.0], 2.6);
    for kind in KINDS {
        let mapped = Mapped::new(&world, kind, 0.1, 3);
        let grid = mapped.grid(options(), [1.0, 1.0, 0.2]);
        let p = mapped.map_from_world * nalgebra::Point3::new(2.5, 2.0, 0.0);
        assert_eq!(grid.at_m(p.x, p.y), Cell::Unknown);
        assert_eq!(grid.count(Cell::Occupied), 0, "{kind}");
        assert!(grid.count(Cell::Free) > 1800, "{kind}");
    }
}

#[test]
fn options_out_of_range_are_refused_by_name() {
    let lattice = Lattice::new(LatticeKind::Fcc, 0.001).unwrap();
    let refused = |options: ProjectorOptions, part: &str| {
        let error = Projector::new(&lattice, Vector3::zeros(), options)
            .err()
            .unwrap();
        assert!(error.to_string().contains(part), "{error}");
    };
    let ground = |ground: GroundOptions| ProjectorOptions {
        rule: ProjectionRule::Ground(ground),
        ..options()
    };
    let defaults = GroundOptions::default();
    refused(
        ProjectorOptions {
            resolution_m: 0.01,
            ..options()
        },
        "`resolution_m`",
    );
    refused(
        ProjectorOptions {
            resolution_m: f64::NAN,
            ..options()
        },
        "`resolution_m`",
    );
    refused(
        ground(GroundOptions {
            max_step_m: 0.0,
            ..defaults
        }),
        "`max_step_m`",
    );
    refused(
        ground(GroundOptions {
            max_slope_deg: 90.0,
            ..defaults
        }),
        "`max_slope_deg`",
    );
    refused(
        ground(GroundOptions {
            robot_height_m: f64::NAN,
            ..defaults
        }),
        "`robot_height_m`",
    );
    let band = ProjectionRule::Flat {
        min_z_m: 1.0,
        max_z_m: 0.0,
    };
    refused(
        ProjectorOptions {
            rule: band,
            ..options()
        },
        "`occupancy_min_z_m`",
    );
}
