//! Rises that a robot gets over, and those that it does not.

use super::world::{Mapped, World};
use super::*;

/// Share of several places at which a robot gets from one side of a curb to the other.
fn crossed(kind: LatticeKind, side_m: f64, curb_m: f64) -> f64 {
    climbed(kind, side_m, [0.0, curb_m], GroundOptions::default())
}

/// Share of several places at which a robot gets over a rise of this length and height.
fn climbed(
    kind: LatticeKind,
    side_m: f64,
    [length_m, rise_m]: [f64; 2],
    robot: GroundOptions,
) -> f64 {
    let end_m = 4.0 + length_m;
    let world = World::default()
        .floor([0.0, 0.0], [4.0, 4.0], 0.0)
        .patch([4.0, 0.0, 0.0], [length_m, 0.0, rise_m], [0.0, 4.0, 0.0])
        .floor([end_m, 0.0], [end_m + 4.0, 4.0], rise_m);
    let options = ProjectorOptions {
        rule: ProjectionRule::Ground(robot),
        ..options()
    };
    let crosses = |seed: u64| {
        let mapped = Mapped::new(&world, kind, side_m, seed);
        let grid = mapped.grid(options, [1.0, 1.0, 0.2]);
        let reached = mapped.flood(&grid, [1.5, 2.0], |_, _| true);
        reached.iter().any(|at| at[0] > end_m + 1.0)
    };
    let count = (0..SEEDS).filter(|seed| crosses(*seed)).count();
    count as f64 / SEEDS as f64
}

#[test]
fn a_short_steep_ramp_is_driven_over_if_its_rise_is_a_step() {
    // 30 and 45 degrees, where 20 are the limit.
    for size_m in [[0.4, 0.23], [0.2, 0.2], [0.0, 0.2]] {
        for kind in KINDS {
            for (max_step_m, share) in [(0.1, 0.0), (0.13, 0.0), (0.3, 1.0)] {
                let robot = GroundOptions {
                    max_step_m,
                    ..GroundOptions::default()
                };
                let found = climbed(kind, 0.1, size_m, robot);
                assert_eq!(
                    found, share,
                    "{kind}: {size_m:?} m, steps of {max_step_m} m"
                );
            }
        }
    }
}

#[test]
fn steps_are_told_apart_in_cells_that_are_larger_than_they_are() {
    for side_m in [0.1, 0.2, 0.3] {
        for kind in KINDS {
            assert!(crossed(kind, side_m, 0.05) >= 1.0, "{kind} {side_m}");
            assert!(crossed(kind, side_m, 0.2) <= 0.0, "{kind} {side_m}");
        }
        assert!(crossed(LatticeKind::Fcc, side_m, 0.15) <= 0.0, "{side_m}");
    }
}
