//! Layers of the ground against the truth of worlds.

use super::world::{Mapped, World};
use super::*;

/// Values of a layer at positions of a world.
struct Layers {
    mapped: Mapped,
    grid: Grid,
    found: Elevation,
}

impl Layers {
    fn new(world: &World, kind: LatticeKind, seed: u64, robot: [f64; 3]) -> Layers {
        Layers::with(options(), world, kind, seed, robot)
    }

    fn with(
        options: ProjectorOptions,
        world: &World,
        kind: LatticeKind,
        seed: u64,
        robot: [f64; 3],
    ) -> Layers {
        let mapped = Mapped::new(world, kind, 0.1, seed);
        let robot_m = mapped.map_from_world * nalgebra::Point3::from(robot);
        let mut projector = mapped.projector(options);
        let (grid, found) = projector
            .grid_and_elevation(Some(robot_m.coords), None)
            .unwrap();
        let found = found.unwrap();
        Layers {
            mapped,
            grid,
            found,
        }
    }

    /// Index of the cell at a position.
    fn at(&self, x: f64, y: f64) -> usize {
        let p = self.mapped.map_from_world * nalgebra::Point3::new(x, y, 0.0);
        self.found.index_at_m(p.x, p.y).unwrap()
    }

    /// Cells with a surface at places: nearly all.
    fn known(&self, name: &str, low: [f64; 2], high: [f64; 2]) -> Vec<(usize, [f64; 2])> {
        let all = places(low, high).map(|[x, y]| (self.at(x, y), [x, y]));
        let (known, holes): (Vec<_>, Vec<_>) =
            all.partition(|(i, _)| self.found.elevation_m[*i].is_finite());
        println!("{name}: {} of {} holes", holes.len(), known.len());
        assert!(50 * holes.len() <= known.len(), "{name}: {}", holes.len());
        known
    }

    /// Height in the world.
    fn z(&self, i: usize) -> f64 {
        f64::from(self.found.elevation_m[i]) - self.mapped.map_from_world.translation.z
    }
}

/// Positions of a rectangle, 7 cm apart.
fn places(low: [f64; 2], high: [f64; 2]) -> impl Iterator<Item = [f64; 2]> {
    let along = move |axis: usize| {
        let count = ((high[axis] - low[axis]) / 0.07) as usize;
        (0..=count).map(move |i| low[axis] + 0.07 * i as f64)
    };
    along(0).flat_map(move |x| along(1).map(move |y| [x, y]))
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
    sum / f64::from(count)
}

fn worlds() -> impl Iterator<Item = (LatticeKind, u64)> {
    KINDS
        .into_iter()
        .flat_map(|kind| (0..SEEDS).map(move |seed| (kind, seed)))
}

#[test]
fn a_ramp_has_its_heights_and_its_slope() {
    let slope_rad = 15.0_f64.to_radians();
    let rise = slope_rad.tan();
    let world = World::default()
        .floor([0.0, 0.0], [4.0, 5.0], 0.0)
        .patch([4.0, 0.0, 0.0], [4.0, 0.0, 4.0 * rise], [0.0, 5.0, 0.0])
        .floor([8.0, 0.0], [12.0, 5.0], 4.0 * rise);
    for (kind, seed) in worlds() {
        let layers = Layers::new(&world, kind, seed, [1.0, 1.0, 0.2]);
        let found = &layers.found;
        for (low, high, slope_rad) in [
            ([5.0, 1.0], [7.0, 4.0], slope_rad),
            ([1.0, 1.0], [3.0, 4.0], 0.0),
        ] {
            let name = format!("{kind} {seed}, slope {slope_rad:.3}");
            let known = layers.known(&name, low, high);
            let errors_m = known.iter().map(|(i, [x, y])| {
                let truth_m = (x - 4.0).max(0.0) * rise;
                // The cell's own place is at most half its diagonal away.
                let error_m = (layers.z(*i) - truth_m).abs();
                assert!(error_m < 0.08, "{name}: {error_m} at {x} {y}");
                error_m
            });
            let error_m = mean(errors_m);
            let of = |layer: &[f32]| mean(known.iter().map(|(i, _)| f64::from(layer[*i])));
            let (slope, value) = (of(&found.slope_rad), of(&found.traversability));
            println!("{name}: height {error_m:.3} slope {slope:.3} traversability {value:.3}");
            assert!(error_m < 0.02, "{name}: {error_m}");
            assert!((slope - slope_rad).abs() < 0.01, "{name}: {slope}");
            let flat = 1.0 - slope_rad / 20.0_f64.to_radians();
            assert!((0.01..flat + 0.15).contains(&value), "{name}: {value}");
        }
    }
}

#[test]
fn a_curb_has_its_step_and_what_is_above_it_its_height() {
    let curb_m = 0.2;
    let world = World::default()
        .floor([0.0, 0.0], [4.0, 5.0], 0.0)
        .wall([4.0, 0.0], [4.0, 5.0], [0.0, curb_m])
        .floor([4.0, 0.0], [8.0, 5.0], curb_m);
    let legs = GroundOptions {
        max_step_m: 0.25,
        ..GroundOptions::default()
    };
    let (mut climbed, mut cells) = (0, 0);
    for (kind, seed) in worlds() {
        for (robot, climbs) in [(GroundOptions::default(), false), (legs, true)] {
            let options = ProjectorOptions {
                rule: ProjectionRule::Ground(robot),
                ..options()
            };
            let layers = Layers::with(options, &world, kind, seed, [1.0, 1.0, 0.2]);
            let found = &layers.found;
            let name = format!("{kind} {seed}, climbs {climbs}");
            // Not reached by wheels, and yet ground.
            for (i, [x, y]) in layers.known(&name, [4.5, 1.0], [7.0, 4.0]) {
                let z_m = layers.z(i);
                assert!((z_m - curb_m).abs() < 0.03, "{name}: {z_m} at {x} {y}");
                assert_eq!(found.traversability[i].is_nan(), !climbs, "{name}");
            }
            let away = layers.known(&name, [1.0, 1.0], [3.0, 4.0]);
            let away_m = mean(away.iter().map(|(i, _)| f64::from(found.step_m[*i])));
            assert!(away_m < 0.05, "{name}: {away_m}");
            let line = (0..40).map(|i| layers.at(4.0, 0.5 + 0.1 * f64::from(i)));
            let steps = line.clone().map(|i| f64::from(found.step_m[i]));
            let values: Vec<f32> = line.map(|i| found.traversability[i]).collect();
            let blocked = values.iter().filter(|value| **value <= 0.0).count();
            let driven = values.iter().filter(|value| **value > 0.0).count();
            let step_m = steps.fold(0.0, f64::max);
            println!(
                "{name}: step {step_m:.3}, away {away_m:.3}, blocked {blocked}, driven {driven}"
            );
            match climbs {
                true => {
                    assert!((step_m - curb_m).abs() < 0.04, "{name}: {step_m}");
                    climbed += driven;
                    cells += values.len();
                }
                false => assert!(blocked > 25 && driven == 0, "{name}: {values:?}"),
            }
        }
    }
    assert!(50 * climbed >= 49 * cells, "{climbed} of {cells}");
}

#[test]
fn a_bridge_has_a_clearance_below_and_none_above() {
    let world = World::default()
        .floor([0.0, 0.0], [12.0, 4.0], 0.0)
        .solid([5.0, -3.0, 2.6], [7.0, 7.0, 3.0])
        .floor([4.0, -9.0], [8.0, -3.0], 3.0);
    for (kind, seed) in worlds() {
        let road = Layers::new(&world, kind, seed, [1.0, 1.0, 0.2]);
        let deck = Layers::new(&world, kind, seed, [6.0, -6.0, 3.2]);
        let name = format!("{kind} {seed}");
        for (i, _) in road.known(&name, [5.3, 0.5], [6.7, 3.5]) {
            let (z_m, clearance_m) = (road.z(i), road.found.clearance_m[i]);
            assert!(z_m.abs() < 0.03, "{name}: {z_m}");
            assert!((clearance_m - 2.6).abs() < 0.08, "{name}: {clearance_m}");
        }
        for (i, _) in deck.known(&name, [5.3, 0.5], [6.7, 3.5]) {
            assert!((deck.z(i) - 3.0).abs() < 0.03, "{name}: {}", deck.z(i));
            assert!(deck.found.clearance_m[i].is_nan(), "{name}");
        }
        for (i, _) in road.known(&name, [1.0, 0.5], [4.0, 3.5]) {
            assert!(road.found.clearance_m[i].is_nan(), "{name}");
        }
    }
}

#[test]
fn traversability_is_that_of_the_grid_and_a_square_a_part_of_it() {
    let world = World::default()
        .floor([0.0, 0.0], [9.0, 5.0], 0.0)
        .solid([3.0, 1.0, 0.0], [4.0, 2.0, 0.7])
        .wall([9.0, 0.0], [9.0, 5.0], [0.0, 2.4])
        .floor([11.0, 0.0], [14.0, 5.0], 0.0);
    for (kind, seed) in worlds() {
        let layers = Layers::new(&world, kind, seed, [1.0, 1.0, 0.2]);
        let (grid, whole) = (&layers.grid, &layers.found);
        let rectangle = (whole.corner, whole.width, whole.height);
        assert_eq!(rectangle, (grid.corner, grid.width, grid.height));
        for (i, cell) in grid.cells.iter().enumerate() {
            let value = whole.traversability[i];
            let is_right = match cell {
                Cell::Unknown => value.is_nan(),
                Cell::Occupied => value == 0.0,
                Cell::Free => (0.0..=1.0).contains(&value) && whole.elevation_m[i].is_finite(),
            };
            assert!(is_right, "{kind} {seed}: {cell:?} {value}");
        }
        // The top of a box, which is not reached.
        let top_m = layers.z(layers.at(3.5, 1.5));
        assert!((top_m - 0.7).abs() < 0.03, "{top_m}");
        assert!(
            whole.elevation_m[layers.at(10.0, 2.5)].is_nan(),
            "never seen"
        );

        let at = layers.mapped.map_from_world * nalgebra::Point3::new(2.0, 2.0, 0.0);
        let square = Square {
            center_m: [at.x, at.y],
            length_m: 4.0,
        };
        let mut projector = layers.mapped.projector(options());
        let mut part = |square| {
            let robot = layers.mapped.map_from_world * nalgebra::Point3::new(1.0, 1.0, 0.2);
            projector
                .grid_and_elevation(Some(robot.coords), Some(square))
                .unwrap()
                .1
        };
        let found = part(square).unwrap();
        assert_eq!((found.width, found.height), (40, 40));
        for x in 0..40 {
            for y in 0..40 {
                let along =
                    |corner: i32, i: i32| (f64::from(corner + i) + 0.5) * found.resolution_m;
                let (x_m, y_m) = (along(found.corner[0], x), along(found.corner[1], y));
                assert!((x_m - at.x).abs() < 2.11 && (y_m - at.y).abs() < 2.11);
                let i = (y * 40 + x) as usize;
                assert_eq!(found.index_at_m(x_m, y_m), Some(i));
                let wanted = whole.index_at_m(x_m, y_m);
                let layer = |layers: [(&str, &[f32]); 5], i: usize| {
                    layers.map(|(_, layer)| layer[i].to_bits())
                };
                match wanted.filter(|i| grid.cells[*i] == Cell::Free) {
                    Some(whole_i) => {
                        assert_eq!(layer(found.layers(), i), layer(whole.layers(), whole_i));
                    }
                    None => {
                        assert!(found.traversability[i].is_nan() || found.traversability[i] <= 0.0)
                    }
                }
            }
        }
        let error = part(Square {
            length_m: 1e12,
            ..square
        });
        assert!(
            error
                .unwrap_err()
                .to_string()
                .contains("`elevation_length_m`")
        );
    }
}
