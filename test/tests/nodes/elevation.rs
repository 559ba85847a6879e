//! Elevation of a followed map, in the layout of grid_map.

use lattice_core::lattice::LatticeKind;
use lattice_core::navigation::{ProjectionRule, ProjectorOptions};
use lattice_msgs::grid_map_msgs::GridMap;
use lattice_nodes::lattice_mapper::LatticeMapper;
use lattice_nodes::map_projector::{MapProjector, MapProjectorOptions};
use lattice_test::maps::{self, insert};

/// Points of a floor, 10 cm apart, from a corner.
fn floor(corner: [f32; 2], size: [u8; 2], z: f32) -> Vec<[f32; 3]> {
    let along = |begin: f32, count: u8| (0..count).map(move |i| begin + 0.1 * f32::from(i) + 0.05);
    let rows = along(corner[1], size[1]);
    rows.flat_map(|y| along(corner[0], size[0]).map(move |x| [x, y, z]))
        .collect()
}

fn options(elevation_length_m: f64) -> MapProjectorOptions {
    MapProjectorOptions {
        elevation_length_m,
        ..MapProjectorOptions::default()
    }
}

fn machine(options: MapProjectorOptions, robot: Option<[f64; 3]>) -> MapProjector {
    let mut machine = MapProjector::new(options);
    if let Some(robot) = robot {
        machine.set_robot(robot.into());
    }
    machine
}

fn mapper(points: &[[f32; 3]]) -> LatticeMapper {
    let mut mapper = maps::mapper(maps::options(LatticeKind::Fcc, 0.001));
    insert(&mut mapper, points);
    mapper.take_update();
    mapper
}

fn send(machine: &mut MapProjector, mapper: &mut LatticeMapper) {
    for chunk in mapper.keyframe() {
        machine.on_map(&chunk).unwrap();
    }
}

fn take(machine: &mut MapProjector) -> Option<GridMap> {
    machine.take_change();
    machine.take_elevation()
}

/// Value of a layer at a position, as `GridMap::atPosition` of grid_map.
fn at(map: &GridMap, layer: &str, x_m: f64, y_m: f64) -> f32 {
    let info = &map.info;
    let index = |center_m: f64, length_m: f64, at_m: f64| {
        ((center_m + 0.5 * length_m - at_m) / info.resolution).floor() as usize
    };
    let row = index(info.pose.position.x, info.length_x, x_m);
    let column = index(info.pose.position.y, info.length_y, y_m);
    let i = map.layers.iter().position(|name| name == layer).unwrap();
    let array = &map.data[i];
    let [outer, inner] = &array.layout.dim[..] else {
        panic!("{:?}", array.layout);
    };
    assert_eq!(
        [outer.label.as_str(), inner.label.as_str()],
        ["column_index", "row_index"]
    );
    assert!(row < inner.size as usize && column < outer.size as usize);
    array.data[column * inner.stride as usize + row]
}

fn bits(map: &GridMap) -> Vec<Vec<u32>> {
    let layers = map.data.iter();
    layers
        .map(|layer| layer.data.iter().map(|value| value.to_bits()).collect())
        .collect()
}

#[test]
fn elevation_is_made_only_where_it_is_drawn_and_follows_the_map() {
    let robot = Some([1.0, 1.0, 0.3]);
    let mut mapper = mapper(&floor([0.0, 0.0], [60, 40], 0.0));
    let mut machine = machine(options(10.0), robot);
    send(&mut machine, &mut mapper);
    assert_eq!(take(&mut machine), None, "nobody subscribes");
    assert_eq!(machine.counts().elevations_out, 0);
    // A subscriber gets one at once, and only one.
    machine.draw_elevation(true);
    let first = take(&mut machine).unwrap();
    assert_eq!(take(&mut machine), None, "no change");
    machine.draw_elevation(true);
    assert_eq!(take(&mut machine), None, "no change");
    assert_eq!(
        (first.header.frame_id.as_str(), first.layers.len()),
        ("map", 5)
    );
    assert_eq!((first.outer_start_index, first.inner_start_index), (0, 0));
    assert!(at(&first, "elevation", 2.0, 2.0).abs() < 0.01);
    assert!(at(&first, "elevation", -1.0, 2.0).is_nan());
    // What is built comes with the update, as in the elevation of the map as it is.
    insert(&mut mapper, &floor([2.0, 1.0], [10, 20], 0.4));
    for chunk in mapper.take_update() {
        machine.on_update(&chunk).unwrap();
    }
    let second = take(&mut machine).unwrap();
    assert!((at(&second, "elevation", 2.5, 2.0) - 0.4).abs() < 0.02);
    assert_eq!(at(&second, "traversability", 2.5, 2.0), 0.0);
    let mut fresh = self::machine(options(10.0), robot);
    fresh.draw_elevation(true);
    send(&mut fresh, &mut mapper);
    assert_eq!(bits(&take(&mut fresh).unwrap()), bits(&second));
    assert_eq!(machine.counts().elevations_out, 2);
    // A subscriber that joins gets it without a change of the map.
    machine.draw_elevation(false);
    machine.draw_elevation(true);
    assert_eq!(bits(&take(&mut machine).unwrap()), bits(&second));
    // Nobody is left.
    machine.draw_elevation(false);
    machine.set_robot([4.0, 1.0, 0.3].into());
    assert!(machine.take_change().is_none() && machine.take_elevation().is_none());
}

#[test]
fn the_square_goes_with_the_robot() {
    let mut mapper = mapper(&floor([0.0, 0.0], [200, 40], 0.0));
    let mut machine = machine(options(4.0), None);
    machine.draw_elevation(true);
    send(&mut machine, &mut mapper);
    assert!(take(&mut machine).is_none() && machine.misses_robot());
    for x_m in [3.0, 3.2, 9.0] {
        machine.set_robot([x_m, 2.0, 0.3].into());
        let found = take(&mut machine);
        assert!(!machine.misses_robot());
        if x_m == 3.2 {
            assert_eq!(found, None, "nearly there");
            continue;
        }
        let found = found.unwrap();
        let (info, center) = (&found.info, &found.info.pose.position);
        assert!(
            (center.x - x_m).abs() < 0.06 && (center.y - 2.0).abs() < 0.06,
            "{info:?}"
        );
        assert!(
            (info.length_x - 4.0).abs() < 0.11 && info.length_x == info.length_y,
            "{info:?}"
        );
        // The corner is a multiple of the resolution, as that of the grid.
        let corner = (center.x - 0.5 * info.length_x) / info.resolution;
        assert!((corner - corner.round()).abs() < 1e-6, "{corner}");
        assert!(at(&found, "elevation", x_m + 1.5, 2.0).abs() < 0.02);
    }
}

#[test]
fn the_whole_map_needs_no_robot_and_has_a_limit() {
    let mut mapper = mapper(&floor([0.0, 0.0], [60, 40], 0.0));
    let mut whole = machine(options(0.0), None);
    whole.draw_elevation(true);
    send(&mut whole, &mut mapper);
    let found = take(&mut whole).unwrap();
    assert!(at(&found, "elevation", 5.8, 3.8).abs() < 0.02);
    assert!(
        found.info.length_x > 5.9 && found.info.length_x < 7.0,
        "{:?}",
        found.info
    );

    let mut wide = machine(options(10_000.0), Some([1.0, 1.0, 0.3]));
    wide.draw_elevation(true);
    send(&mut wide, &mut mapper);
    assert!(wide.take_change().is_some(), "the grid is made");
    assert!(wide.take_elevation().is_none());
    let text = wide.error().unwrap().to_string();
    assert!(text.contains("`elevation_length_m`"), "{text}");
    assert_eq!(
        (
            wide.counts().elevations_refused,
            wide.counts().grids_refused
        ),
        (1, 0)
    );
    wide.set_options(options(4.0));
    assert!(take(&mut wide).is_some() && wide.error().is_none());
}

#[test]
fn the_rule_without_ground_has_no_elevation() {
    let rule = ProjectionRule::Flat {
        min_z_m: 0.2,
        max_z_m: 1.5,
    };
    let options = MapProjectorOptions {
        projector: ProjectorOptions {
            rule,
            ..ProjectorOptions::default()
        },
        ..options(0.0)
    };
    let mut machine = machine(options, None);
    machine.draw_elevation(true);
    send(&mut machine, &mut mapper(&floor([0.0, 0.0], [20, 20], 0.5)));
    assert!(machine.take_change().is_some() && machine.take_elevation().is_none());
    assert!(machine.error().is_none() && !machine.misses_robot());
}
