//! Free space from the sensor's clouds to the followers of the map.

use std::sync::Arc;

use lattice_core::lattice::LatticeKind;
use lattice_core::raycast::{Evidence, MIN_MAP_BYTES};
use lattice_core::voxels::file::{MapContents, WriteOptions};
use lattice_msgs::geometry_msgs::Point;
use lattice_msgs::lattice::{ClearBoxRequest, QueryMapRequest};
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_nodes::convert::map::lattice_from;
use lattice_nodes::convert::viewpoint::viewpoints_from_message;
use lattice_nodes::enu_transformer::ins::{InsMessage, InsSource};
use lattice_nodes::enu_transformer::{EnuOutput, EnuTransformer, TransformerOptions};
use lattice_nodes::lattice_mapper::{
    FreeSpaceMethod, LatticeMapper, MapPayload, MappedFreeSpace, MapperOptions,
};
use lattice_nodes::map_follower::MapFollower;
use lattice_test::clouds::{SECOND_NS, cloud, odometry, timed_cloud};
use lattice_test::maps::{self, follow_update, follower};
use nalgebra::{Isometry3, Vector3};

const STEP_NS: i64 = SECOND_NS / 100;

/// A machine that drives east at 1 m/s; its clouds come out with the place of the sensor.
struct Machine {
    transformer: EnuTransformer,
    step: i64,
}

impl Machine {
    fn new() -> Self {
        let options = TransformerOptions {
            viewpoints: true,
            ..TransformerOptions::new(InsSource::Odometry)
        };
        let mut machine = Self {
            transformer: EnuTransformer::new(options),
            step: 0,
        };
        machine.drive();
        machine
    }

    fn drive(&mut self) -> Vec<EnuOutput> {
        let east_m = self.step as f64 * 0.01;
        let place = Isometry3::translation(east_m, 0.0, 0.0);
        let pose = odometry(self.step * STEP_NS, &place);
        self.step += 1;
        let now_ns = pose.header.stamp.to_ns();
        self.transformer
            .on_ins("ins", InsMessage::Odometry(&pose), now_ns)
    }

    /// A cloud of the base frame, in the map.
    fn see(&mut self, message: PointCloud2) -> Arc<PointCloud2> {
        let now_ns = message.header.stamp.to_ns();
        let mut outputs = self
            .transformer
            .on_cloud("points", Arc::new(message), now_ns);
        outputs.extend(self.drive());
        let clouds = outputs.into_iter().filter_map(|output| match output {
            EnuOutput::Points(points) => Some(points),
            _ => None,
        });
        clouds.last().unwrap()
    }

    /// A wall so far ahead, seen now.
    fn wall(&mut self, ahead_m: f32) -> Arc<PointCloud2> {
        let grid = (-20..21).flat_map(|y| (-20..21).map(move |z| (y as f32, z as f32)));
        let wall: Vec<_> = grid
            .map(|(y, z)| [ahead_m, y * 0.03 * ahead_m, z * 0.03 * ahead_m])
            .collect();
        self.see(cloud("base_link", (self.step - 1) * STEP_NS, &wall))
    }
}

fn options(method: FreeSpaceMethod, payload: MapPayload) -> MapperOptions {
    MapperOptions {
        payload,
        free_space: MappedFreeSpace {
            method,
            free_level: u32::from(method == FreeSpaceMethod::Evidence),
            ..MappedFreeSpace::default()
        },
        ..maps::options(LatticeKind::Fcc, 0.027)
    }
}

fn each_mapper() -> impl Iterator<Item = LatticeMapper> {
    let methods = [FreeSpaceMethod::Clear, FreeSpaceMethod::Evidence];
    let payloads = [MapPayload::Centroid, MapPayload::Occupancy];
    let methods = methods.into_iter();
    let all = methods.flat_map(move |m| payloads.map(|p| options(m, p)));
    all.map(maps::mapper)
}

/// The follower has exactly the mapper's cells, at their places.
fn assert_same(follower: &MapFollower, mapper: &LatticeMapper) {
    let (map, cells) = (follower.map().unwrap(), mapper.cells());
    let keys = cells.sorted_keys();
    assert_eq!(map.voxels().len(), keys.len());
    for key in keys {
        assert!(map.voxels().contains_key(&key));
        assert!((map.center_m(key) - cells.center_m(key)).norm() < 1e-9);
    }
}

#[test]
fn the_sensor_is_where_it_was_at_the_time_of_each_point() {
    let mut machine = Machine::new();
    for _ in 0..5 {
        machine.drive();
    }
    // Two points, 20 ms apart; a point that is left out leaves no gap.
    let seen = [
        ([1.0, 2.0, 3.0], 0),
        ([f32::NAN; 3], 1),
        ([4.0, 0.0, 0.0], 20_000_000),
    ];
    let message = timed_cloud("base_link", 2 * STEP_NS, &seen);
    let out = machine.see(message);
    let limits = Default::default();
    let viewpoints = viewpoints_from_message(&out, &limits).unwrap().unwrap();
    let expected = [Vector3::new(0.02, 0.0, 0.0), Vector3::new(0.04, 0.0, 0.0)];
    assert_eq!(viewpoints.len(), 2);
    for (viewpoint, expected) in viewpoints.iter().zip(expected) {
        assert!((viewpoint - expected).norm() < 1e-6, "{viewpoint}");
    }
}

#[test]
fn what_stood_in_the_way_goes_from_the_map_and_from_its_followers() {
    for mut mapper in each_mapper() {
        let mut machine = Machine::new();
        let mut follower = follower(&mut mapper);
        let is_near =
            |p: &Vector3<f64>| (2.0..=4.5).contains(&p.x) && p.y.abs() <= 1.0 && p.z.abs() <= 1.0;
        let mut stood = 0;
        for ahead_m in [3.0, 3.0, 9.0, 9.0, 9.0, 9.0, 9.0] {
            mapper.on_cloud(&machine.wall(ahead_m)).unwrap();
            follow_update(&mut follower, &mut mapper);
            assert_same(&follower, &mapper);
            let keys = mapper.cells().sorted_keys().into_iter();
            let centers = keys.map(|key| mapper.cells().center_m(key));
            let left = centers.filter(is_near).count();
            if ahead_m < 5.0 {
                stood = left;
            } else if mapper.counts().clouds_in == 7 {
                let gone = stood > 30 && left * 20 <= stood;
                assert!(gone, "{left} of {stood} are left");
            }
        }
        assert!(mapper.counts().voxels_cleared as usize >= stood * 19 / 20);
        assert!(mapper.cells().len() > 100, "the wall that is there stays");
    }
}

#[test]
fn clouds_without_the_place_of_the_sensor_clear_nothing_and_are_counted() {
    for mut mapper in each_mapper() {
        for x in [3.0, 9.0] {
            maps::insert(&mut mapper, &[[x, 0.0, 0.0]]);
        }
        assert_eq!(mapper.counts().clouds_no_viewpoint, 2);
        assert_eq!((mapper.cells().len(), mapper.counts().rays), (2, 0));
    }
}

#[test]
fn rays_without_room_are_counted() {
    for (max_bytes, refuses) in [(MIN_MAP_BYTES, true), (256 << 20, false)] {
        let mut options = options(FreeSpaceMethod::Evidence, MapPayload::Centroid);
        options.free_space.clear.max_bytes = max_bytes;
        let mut mapper = maps::mapper(options);
        mapper.on_cloud(&Machine::new().wall(90.0)).unwrap();
        assert_eq!(mapper.counts().ray_blocks_refused > 0, refuses);
    }
}

/// The free cells have the place of the map, are wider, and hold nothing that is occupied.
#[test]
fn free_cells_are_published_as_a_map_of_their_own() {
    let options = options(FreeSpaceMethod::Evidence, MapPayload::Centroid);
    let mut mapper = maps::mapper(options);
    mapper.on_cloud(&Machine::new().wall(5.0)).unwrap();
    let chunks = mapper.free().unwrap();
    let (lattice, datum_m) = lattice_from(&chunks[0].info).unwrap();
    assert_eq!(datum_m, mapper.list().datum_m());
    let volume_m3 = mapper.list().lattice().cell_volume_m3();
    assert!((lattice.cell_volume_m3() / volume_m3 - 8.0).abs() < 1e-9);
    let mut follower = MapFollower::new(1_000_000);
    for chunk in &chunks {
        follower.on_map(chunk).unwrap();
    }
    let free = follower.map().unwrap().voxels();
    let at = |x: f64| {
        let offset_m = Vector3::new(x, 0.0, 0.0) - datum_m;
        let w = lattice.quantize(&offset_m).unwrap();
        free.keys().any(|key| key.unpack() == w)
    };
    assert!(at(1.0) && at(3.0) && !at(5.0) && !at(7.0));
}

/// A map of occupancy is saved, loaded by another node and continued; loaded cells can be cleared.
#[test]
fn a_map_of_occupancy_is_saved_and_loaded() {
    for method in [FreeSpaceMethod::Clear, FreeSpaceMethod::Evidence] {
        let new = || maps::mapper(options(method, MapPayload::Occupancy));
        let (mut first, mut second) = (new(), new());
        let mut machine = Machine::new();
        first.on_cloud(&machine.wall(3.0)).unwrap();
        let mut file = Vec::new();
        let contents = first.contents();
        contents.write(&mut file, &WriteOptions::default()).unwrap();
        let contents = MapContents::read(file.as_slice(), 1_000_000).unwrap();
        assert_eq!(second.load(contents, 9).unwrap(), first.cells().len());
        assert_eq!(second.cells().sorted_keys(), first.cells().sorted_keys());
        assert_same(&follower(&mut second), &second);
        for _ in 0..4 {
            second.on_cloud(&machine.wall(9.0)).unwrap();
        }
        assert!(second.counts().voxels_cleared > 100);
    }
}

#[test]
fn boxes_queries_and_centres_work_without_payload() {
    let options = options(FreeSpaceMethod::Off, MapPayload::Occupancy);
    let mut mapper = maps::mapper(options);
    maps::insert(&mut mapper, &[[0.1, 0.0, 0.0], [5.0, 0.0, 0.0]]);
    let centers = mapper.centers();
    assert_eq!((centers.width, centers.point_step), (2, 16));
    let (y, z) = (0.0, 0.0);
    let point = Point { x: 5.0, y, z };
    let answer = mapper.query(&QueryMapRequest { point });
    assert!(answer.success && answer.occupied, "{}", answer.message);
    mapper.take_update();
    let [min, max] = [-1.0, 1.0].map(|x| Point { x, y: x, z: x });
    assert_eq!(mapper.clear_box(&ClearBoxRequest { min, max }).removed, 1);
    let update = mapper.take_update();
    assert_eq!((update.len(), update[0].removed), (1, 1));
    mapper.reset(8);
    assert!(mapper.cells().is_empty() && mapper.take_update().is_empty());
}

#[test]
fn probabilities_that_do_not_go_together_are_refused() {
    let mut bad = options(FreeSpaceMethod::Evidence, MapPayload::Centroid);
    bad.free_space.evidence = Evidence {
        hit: 0.4,
        ..Evidence::default()
    };
    assert!(LatticeMapper::new(bad, 7).is_err());
}

/// Clouds of one sweep are one scan: what one hits, another does not clear.
#[test]
fn what_a_sweep_hits_it_does_not_clear() {
    let seen = |sweep_ns| {
        let mut options = options(FreeSpaceMethod::Clear, MapPayload::Occupancy);
        options.free_space.sweep_ns = sweep_ns;
        let mut mapper = maps::mapper(options);
        let mut machine = Machine::new();
        for ahead_m in [3.0, 9.0, 9.0] {
            mapper.on_cloud(&machine.wall(ahead_m)).unwrap();
        }
        mapper.counts().voxels_cleared
    };
    assert!(seen(0) > 100);
    assert_eq!(seen(SECOND_NS), 0);
}

#[test]
fn what_clears_can_be_changed_while_it_maps() {
    for method in [FreeSpaceMethod::Clear, FreeSpaceMethod::Evidence] {
        let mut changed = options(method, MapPayload::Centroid);
        let mut mapper = maps::mapper(changed.clone());
        // Nothing clears any more: all of each ray is kept.
        changed.free_space.clear.reach.keep_ratio = 1.0;
        let mut machine = Machine::new();
        mapper.on_cloud(&machine.wall(3.0)).unwrap();
        let stood = mapper.cells().len();
        mapper.set_options(changed);
        for _ in 0..4 {
            mapper.on_cloud(&machine.wall(9.0)).unwrap();
        }
        assert_eq!(mapper.counts().voxels_cleared, 0);
        assert!(mapper.cells().len() > stood);
    }
}
