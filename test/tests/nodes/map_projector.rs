//! Grids of a followed map, as Nav2's static layer takes them.

use lattice_core::lattice::LatticeKind;
use lattice_core::navigation::{ProjectionRule, ProjectorOptions};
use lattice_msgs::geometry_msgs::Point;
use lattice_msgs::lattice::ClearBoxRequest;
use lattice_msgs::nav_msgs::OccupancyGrid;
use lattice_nodes::lattice_mapper::LatticeMapper;
use lattice_nodes::map_projector::{MapProjector, MapProjectorOptions, Projected};
use lattice_test::maps::{self, insert};
use lattice_test::static_layer::{FREE, LETHAL, NO_INFORMATION, StaticLayer, StaticLayerOptions};
use nalgebra::Vector3;

const CELL_VOLUME_M3: f64 = 0.008;

/// Points of a floor, 10 cm apart, from a corner.
fn floor(corner: [f32; 2], size: [usize; 2], z: f32) -> Vec<[f32; 3]> {
    let along = |begin: f32, count: usize| (0..count).map(move |i| begin + 0.1 * i as f32 + 0.05);
    let rows = along(corner[1], size[1]);
    rows.flat_map(|y| along(corner[0], size[0]).map(move |x| [x, y, z]))
        .collect()
}

/// Points of a wall of 2 m along y.
fn wall(x: f32, y: [f32; 2]) -> Vec<[f32; 3]> {
    let count = ((y[1] - y[0]) / 0.1) as usize;
    let rows = (0..count).map(|i| y[0] + 0.1 * i as f32 + 0.05);
    rows.flat_map(|y| (0..20).map(move |k| [x, y, 0.1 * k as f32 + 0.05]))
        .collect()
}

fn mapper(kind: LatticeKind) -> LatticeMapper {
    maps::mapper(maps::options(kind, CELL_VOLUME_M3))
}

fn projector(robot: [f64; 3]) -> MapProjector {
    let mut machine = MapProjector::new(MapProjectorOptions::default());
    machine.set_robot(robot.into());
    machine
}

/// A node and the layer behind it.
struct Chain {
    machine: MapProjector,
    layer: StaticLayer,
    grids: usize,
    updates: usize,
}

impl Chain {
    fn new(robot: [f64; 3]) -> Self {
        Self {
            machine: projector(robot),
            layer: StaticLayer::new(StaticLayerOptions::default()),
            grids: 0,
            updates: 0,
        }
    }

    fn keyframe(&mut self, mapper: &mut LatticeMapper) {
        for chunk in mapper.keyframe() {
            self.machine.on_map(&chunk).unwrap();
        }
        self.publish();
    }

    fn update(&mut self, mapper: &mut LatticeMapper) {
        for chunk in mapper.take_update() {
            self.machine.on_update(&chunk).unwrap();
        }
        self.publish();
    }

    fn publish(&mut self) {
        match self.machine.take_change() {
            None => {}
            Some(Projected::Grid(grid)) => {
                self.grids += 1;
                self.layer.on_grid(&grid);
            }
            Some(Projected::Updates(updates)) => {
                assert!(updates.len() <= 4, "Nav2 keeps the last ten");
                self.updates += updates.len();
                updates
                    .iter()
                    .for_each(|update| self.layer.on_update(update));
            }
        }
    }

    /// The layer has the costs of the grid of the mapper's map as it is.
    fn check(&self, mapper: &mut LatticeMapper, robot: [f64; 3]) {
        let mut fresh = projector(robot);
        for chunk in mapper.keyframe() {
            fresh.on_map(&chunk).unwrap();
        }
        let Some(Projected::Grid(whole)) = fresh.take_change() else {
            panic!("no grid");
        };
        assert_eq!(self.layer.warnings, [""; 0]);
        for (x_m, y_m, value) in cells(&whole) {
            let expected = self.layer.cost(value);
            assert_eq!(self.layer.at_m(x_m, y_m), expected, "{x_m} {y_m}");
        }
        let known = |costs: &[u8]| costs.iter().filter(|cost| **cost != NO_INFORMATION).count();
        let values = whole.data.iter().filter(|value| **value >= 0).count();
        assert_eq!(known(&self.layer.costs), values);
    }
}

/// Centres and values of the cells of a grid.
fn cells(grid: &OccupancyGrid) -> impl Iterator<Item = (f64, f64, i8)> + '_ {
    let resolution_m = f64::from(grid.info.resolution);
    let origin = &grid.info.origin.position;
    let width = grid.info.width as usize;
    grid.data.iter().enumerate().map(move |(i, value)| {
        let at = |begin: f64, k: usize| begin + (k as f64 + 0.5) * resolution_m;
        (at(origin.x, i % width), at(origin.y, i / width), *value)
    })
}

#[test]
fn a_static_layer_has_the_grid_of_the_map_after_any_history() {
    let robot = [1.0, 1.0, 0.3];
    for kind in [LatticeKind::Cubic, LatticeKind::Fcc] {
        let mut mapper = mapper(kind);
        insert(&mut mapper, &floor([0.0, 0.0], [60, 40], 0.0));
        mapper.take_update();
        let mut chain = Chain::new(robot);
        chain.keyframe(&mut mapper);
        assert_eq!((chain.grids, chain.layer.at_m(3.0, 2.0)), (1, FREE));
        // A wall is built, and most of it goes.
        insert(&mut mapper, &wall(3.0, [0.0, 4.0]));
        chain.update(&mut mapper);
        chain.check(&mut mapper, robot);
        assert_eq!(chain.layer.at_m(3.0, 2.0), LETHAL);
        let corner = |x, y, z| Point { x, y, z };
        mapper.clear_box(&ClearBoxRequest {
            min: corner(2.5, 1.0, 0.15),
            max: corner(3.5, 4.0, 3.0),
        });
        insert(&mut mapper, &floor([2.5, 1.0], [10, 30], 0.0));
        chain.update(&mut mapper);
        chain.check(&mut mapper, robot);
        assert_eq!(chain.layer.at_m(3.0, 2.5), FREE);
        assert!(chain.updates > 0);
        // 90 m further on, in steps of 3 m: the room is for 20 m.
        for step in 1..=30_u8 {
            insert(
                &mut mapper,
                &floor([3.0 + 3.0 * f32::from(step), 0.0], [30, 40], 0.0),
            );
            chain.update(&mut mapper);
        }
        chain.check(&mut mapper, robot);
        assert_eq!(chain.layer.at_m(90.0, 2.0), FREE);
        assert!(
            (2..=6).contains(&chain.layer.resizes),
            "{}",
            chain.layer.resizes
        );
        assert_eq!(chain.layer.resizes, chain.grids);
        // A map that begins anew is another grid.
        mapper.reset(99);
        insert(&mut mapper, &floor([0.0, 0.0], [60, 40], 0.0));
        mapper.take_update();
        chain.keyframe(&mut mapper);
        chain.check(&mut mapper, robot);
        assert_eq!(chain.layer.at_m(90.0, 2.0), NO_INFORMATION);
    }
}

#[test]
fn origins_are_multiples_of_the_resolution_as_it_is_sent() {
    for resolution_m in [0.0, 0.05, 0.1, 0.3] {
        let mut options = maps::options(LatticeKind::Bcc, 0.001);
        options.datum_near_m = Vector3::new(12_345.6, -6_543.2, 10.0);
        let mut mapper = maps::mapper(options);
        insert(&mut mapper, &floor([12_340.0, -6_540.0], [40, 40], 10.0));
        let mut machine = MapProjector::new(MapProjectorOptions {
            projector: ProjectorOptions {
                resolution_m,
                ..ProjectorOptions::default()
            },
            room_m: 3.3,
            ..MapProjectorOptions::default()
        });
        for chunk in mapper.keyframe() {
            machine.on_map(&chunk).unwrap();
        }
        let Some(Projected::Grid(grid)) = machine.take_change() else {
            panic!("no grid");
        };
        let mut layer = StaticLayer::new(StaticLayerOptions::default());
        layer.on_grid(&grid);
        assert_eq!(layer.warnings, [""; 0]);
        let resolution_m = f64::from(grid.info.resolution);
        let origin = &grid.info.origin.position;
        for value in [origin.x, origin.y] {
            assert_eq!((value / resolution_m).round() * resolution_m, value);
        }
        assert_eq!(grid.header.frame_id, "map");
    }
}

#[test]
fn the_floor_is_that_of_the_robot() {
    // A floor over another one: without a robot the lower one counts.
    let mut mapper = mapper(LatticeKind::Fcc);
    insert(&mut mapper, &floor([0.0, 0.0], [60, 60], 0.0));
    insert(&mut mapper, &floor([0.0, 3.0], [60, 30], 3.0));
    let at = |robot: Option<[f64; 3]>, mapper: &mut LatticeMapper| {
        let mut machine = MapProjector::new(MapProjectorOptions::default());
        if let Some(robot) = robot {
            machine.set_robot(robot.into());
        }
        for chunk in mapper.keyframe() {
            machine.on_map(&chunk).unwrap();
        }
        let mut layer = StaticLayer::new(StaticLayerOptions::default());
        let Some(Projected::Grid(grid)) = machine.take_change() else {
            panic!("no grid");
        };
        layer.on_grid(&grid);
        [1.5, 4.5].map(|y| layer.at_m(3.0, y))
    };
    assert_eq!(at(None, &mut mapper), [FREE, FREE]);
    assert_eq!(at(Some([1.0, 1.0, 0.3]), &mut mapper), [FREE, FREE]);
    let above = at(Some([1.0, 5.0, 3.3]), &mut mapper);
    assert_eq!(above[1], FREE);
    assert_ne!(above[0], FREE, "below the robot's floor");
}

#[test]
fn what_cannot_be_projected_is_counted_with_its_reason() {
    let mut mapper = mapper(LatticeKind::Cubic);
    insert(&mut mapper, &floor([0.0, 0.0], [20, 20], 0.0));
    let mut machine = MapProjector::new(MapProjectorOptions {
        projector: ProjectorOptions {
            resolution_m: 0.001,
            ..ProjectorOptions::default()
        },
        ..MapProjectorOptions::default()
    });
    assert_eq!(machine.take_change(), None);
    for chunk in mapper.keyframe() {
        machine.on_map(&chunk).unwrap();
    }
    assert_eq!(machine.take_change(), None);
    assert_eq!(machine.counts().grids_refused, 1);
    assert!(
        machine
            .error()
            .unwrap()
            .to_string()
            .contains("`resolution_m`")
    );
    // It is set right while the node runs.
    machine.set_options(MapProjectorOptions::default());
    assert!(matches!(machine.take_change(), Some(Projected::Grid(_))));
    assert!(machine.error().is_none() && machine.cells()[0] > 0);
}

#[test]
fn free_cells_count_with_the_flat_rule() {
    let mut mapper = mapper(LatticeKind::Cubic);
    insert(&mut mapper, &wall(1.0, [0.0, 1.0]));
    let mut free = maps::mapper(maps::options(LatticeKind::Cubic, 0.064));
    insert(&mut free, &floor([1.2, 0.0], [20, 10], 0.4));
    let rule = ProjectionRule::Flat {
        min_z_m: 0.2,
        max_z_m: 1.5,
    };
    let mut machine = MapProjector::new(MapProjectorOptions {
        projector: ProjectorOptions {
            rule,
            ..ProjectorOptions::default()
        },
        ..MapProjectorOptions::default()
    });
    for chunk in mapper.keyframe() {
        machine.on_map(&chunk).unwrap();
    }
    let mut layer = StaticLayer::new(StaticLayerOptions::default());
    let mut take = |machine: &mut MapProjector| {
        match machine.take_change() {
            Some(Projected::Grid(grid)) => layer.on_grid(&grid),
            Some(Projected::Updates(updates)) => {
                updates.iter().for_each(|update| layer.on_update(update));
            }
            None => panic!("no change"),
        }
        [1.0, 2.5, 5.0].map(|x| layer.at_m(x, 0.5))
    };
    assert_eq!(take(&mut machine), [LETHAL, NO_INFORMATION, NO_INFORMATION]);
    for chunk in free.keyframe() {
        machine.on_free(&chunk).unwrap();
    }
    assert_eq!(take(&mut machine), [LETHAL, FREE, NO_INFORMATION]);
}

#[test]
fn the_twin_of_the_layer_has_its_thresholds() {
    let layer = StaticLayer::new(StaticLayerOptions::default());
    assert_eq!(
        [-1, 0, 99, 100].map(|value| layer.cost(value)),
        [NO_INFORMATION, FREE, FREE, LETHAL]
    );
    let scaled = StaticLayer::new(StaticLayerOptions {
        trinary: false,
        track_unknown: false,
        lethal_threshold: 80,
        ..StaticLayerOptions::default()
    });
    assert_eq!(
        [-1, 0, 40, 80].map(|value| scaled.cost(value)),
        [FREE, FREE, 127, LETHAL]
    );
}
