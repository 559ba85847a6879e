//! Limits, ageing and services of the mapper: followers see what goes and what is loaded.

use lattice_core::lattice::LatticeKind;
use lattice_core::voxels::WhenFull;
use lattice_core::voxels::file::{MapContents, WriteOptions};
use lattice_msgs::geometry_msgs::Point;
use lattice_msgs::lattice::{ClearBoxRequest, QueryMapRequest};
use lattice_nodes::lattice_mapper::{LatticeMapper, LoadRefusal, MapperOptions};
use lattice_nodes::map_follower::MapFollower;
use lattice_test::clouds::{SECOND_NS, cloud};
use lattice_test::maps;
use nalgebra::Vector3;

fn options(kind: LatticeKind) -> MapperOptions {
    maps::options(kind, 0.125)
}

/// A row of points 1 m apart, from `first` on.
fn row(first: i32, count: i32) -> Vec<[f32; 3]> {
    let row = first..first + count;
    row.map(|x| [x as f32, 0.0, 0.0]).collect()
}

/// A mapper and one who follows its updates only.
struct Pair {
    mapper: LatticeMapper,
    follower: MapFollower,
}

impl Pair {
    fn new(options: MapperOptions) -> Pair {
        let mut mapper = maps::mapper(options);
        let follower = maps::follower(&mut mapper);
        Pair { mapper, follower }
    }

    fn insert(&mut self, stamp_s: i32, points: &[[f32; 3]]) {
        let cloud = cloud("map", i64::from(stamp_s) * SECOND_NS, points);
        self.mapper.on_cloud(&cloud).unwrap();
        self.follow();
    }

    /// A cloud of another time, which is believed when it comes the fifth time.
    fn insert_at_last(&mut self, stamp_s: i32, points: &[[f32; 3]]) {
        let cloud = cloud("map", i64::from(stamp_s) * SECOND_NS, points);
        for _ in 0..4 {
            self.mapper.on_cloud(&cloud).unwrap_err();
        }
        self.insert(stamp_s, points);
    }

    fn follow(&mut self) {
        maps::follow_update(&mut self.follower, &mut self.mapper);
        let voxels = self.follower.map().unwrap().voxels();
        let mut keys: Vec<_> = voxels.keys().copied().collect();
        keys.sort();
        assert_eq!(keys, self.mapper.cells().sorted_keys());
        self.mapper.list().validate().unwrap();
    }

    /// Occupancy of places on the x axis, each true if a voxel is there.
    fn occupied<const N: usize>(&self, places: [f64; N]) -> [bool; N] {
        places.map(|x| self.has(x))
    }

    fn has(&self, x: f64) -> bool {
        let answer = self.mapper.query(&at(x, 0.0, 0.0));
        assert!(answer.success, "{}", answer.message);
        answer.occupied
    }
}

fn at(x: f64, y: f64, z: f64) -> QueryMapRequest {
    let point = Point { x, y, z };
    QueryMapRequest { point }
}

#[test]
fn a_full_map_refuses_or_forgets_the_oldest() {
    for kind in LatticeKind::ALL {
        let pair = |when_full| {
            Pair::new(MapperOptions {
                max_voxels: 40,
                when_full,
                ..options(kind)
            })
        };
        let mut refusing = pair(WhenFull::Refuse);
        let mut forgetting = pair(WhenFull::ForgetOldest);
        for step in 0..20 {
            refusing.insert(step, &row(step * 4, 4));
            forgetting.insert(step, &row(step * 4, 4));
        }
        assert_eq!(refusing.occupied([0.0, 79.0]), [true, false]);
        assert_eq!(refusing.mapper.counts().points_list_full, 40);
        assert_eq!(forgetting.occupied([0.0, 79.0]), [false, true]);
        assert_eq!(forgetting.mapper.counts().points_list_full, 0);
        let len = forgetting.mapper.list().len() as u64;
        assert_eq!(forgetting.mapper.counts().voxels_forgotten, 80 - len);
        assert!((30..=40).contains(&len), "{len}");
    }
}

#[test]
fn memory_bounds_the_map() {
    let limit = |forget_after_ns| {
        let mapper = maps::mapper(MapperOptions {
            max_map_bytes: 1_000_000,
            forget_after_ns,
            ..options(LatticeKind::Bcc)
        });
        mapper.list().max_voxels()
    };
    assert!((500..3000).contains(&limit(0)), "{}", limit(0));
    assert!(limit(1) < limit(0));
}

#[test]
fn old_voxels_go_by_the_time_of_the_clouds() {
    let forget_after_ns = 10 * SECOND_NS;
    let mut pair = Pair::new(MapperOptions {
        forget_after_ns,
        ..options(LatticeKind::Hex)
    });
    pair.insert(100, &row(0, 5));
    pair.insert(105, &row(3, 5));
    assert!(pair.has(0.0));
    pair.insert(108, &[]);
    pair.insert(111, &row(20, 1));
    let found = pair.occupied([0.0, 2.0, 3.0, 7.0, 20.0]);
    assert_eq!(found, [false, false, true, true, true]);
    // Time goes on after a pause once several clouds agree; then the log begins again.
    pair.insert_at_last(130, &[]);
    assert!(pair.mapper.list().is_empty());
    assert_eq!(pair.mapper.counts().voxels_forgotten, 9);
    pair.insert_at_last(100, &row(0, 5));
    assert!(pair.has(0.0));
    assert_eq!(pair.mapper.counts().clouds_stamp_jump, 8);
}

#[test]
fn a_cloud_from_another_year_makes_no_voxel_old() {
    let mut pair = Pair::new(MapperOptions {
        forget_after_ns: 10 * SECOND_NS,
        ..options(LatticeKind::Fcc)
    });
    let year_s = 31_557_600;
    for stamp_s in 100..110 {
        pair.insert(stamp_s, &row(stamp_s, 1));
        for wrong_s in [year_s, stamp_s - 90] {
            let wrong = cloud("map", i64::from(wrong_s) * SECOND_NS, &row(0, 1));
            let refusal = pair.mapper.on_cloud(&wrong).unwrap_err().to_string();
            assert!(refusal.contains("clock"), "{refusal}");
            pair.insert(stamp_s, &[]);
        }
    }
    assert_eq!(pair.mapper.list().len(), 10);
    assert_eq!(pair.mapper.counts().clouds_stamp_jump, 20);
    // One that comes first is held against nothing, and does no harm either.
    let mut loaded = maps::mapper(MapperOptions {
        forget_after_ns: 10 * SECOND_NS,
        ..options(LatticeKind::Fcc)
    });
    loaded.load(pair.mapper.contents(), 8).unwrap();
    let wrong = cloud("map", i64::from(year_s) * SECOND_NS, &[]);
    loaded.on_cloud(&wrong).unwrap();
    assert_eq!(loaded.list().len(), 10);
}

#[test]
fn a_cleared_box_is_gone_for_followers_too() {
    let mut pair = Pair::new(options(LatticeKind::Cubic));
    pair.insert(1, &row(0, 10));
    let corner = |x, side| Point {
        x,
        y: side,
        z: side,
    };
    let (min, max) = (corner(1.5, -1.0), corner(4.5, 1.0));
    let request = ClearBoxRequest { min, max };
    let before = pair.mapper.state();
    let answer = pair.mapper.clear_box(&request);
    assert!(answer.success && answer.removed == 3, "{answer:?}");
    assert_ne!(pair.mapper.state(), before);
    pair.follow();
    let found = pair.occupied([1.0, 2.0, 4.0, 5.0]);
    assert_eq!(found, [true, false, false, true]);
    for bad in [f64::NAN, -5.0] {
        let (min, max) = (corner(1.5, -1.0), corner(bad, 1.0));
        let answer = pair.mapper.clear_box(&ClearBoxRequest { min, max });
        let message = &answer.message;
        assert!(!answer.success && message.contains("corner"), "{message}");
    }
    assert_eq!(pair.mapper.list().len(), 7);
}

#[test]
fn a_query_tells_what_is_near() {
    let mut pair = Pair::new(options(LatticeKind::Cubic));
    let empty = pair.mapper.query(&at(0.0, 0.0, 0.0));
    assert!(empty.success && !empty.occupied && !empty.has_nearest);
    pair.insert(1, &[[0.0; 3], [0.1; 3], [5.0, 0.0, 0.0]]);
    let inside = pair.mapper.query(&at(0.1, 0.0, 0.0));
    assert!(inside.occupied && inside.points == 2 && inside.clearance_m == 0.0);
    let outside = pair.mapper.query(&at(0.0, 3.0, 0.0));
    assert!(!outside.occupied && outside.points == 0 && outside.has_nearest);
    assert!((outside.clearance_m - 2.75).abs() < 1e-12, "{outside:?}");
    assert!((outside.nearest_distance_m - 3.0).abs() < 1e-12);
    assert_eq!(outside.nearest, Point::default());
    let nowhere = pair.mapper.query(&at(0.0, f64::NAN, 0.0));
    assert!(!nowhere.success && nowhere.message.contains("finite"));
}

#[test]
fn a_loaded_map_replaces_all() {
    let mut source = Pair::new(options(LatticeKind::Fcc));
    source.insert(1, &row(0, 30));
    let mut bytes = Vec::new();
    let written = source.mapper.contents();
    written.write(&mut bytes, &WriteOptions::default()).unwrap();
    let contents = || MapContents::read(&bytes[..], 1000).unwrap();

    // Counted from another datum; what was there before is gone.
    let datum_near_m = Vector3::new(700.0, -30.0, 4.0);
    let mut pair = Pair::new(MapperOptions {
        datum_near_m,
        ..options(LatticeKind::Fcc)
    });
    pair.insert(1, &row(500, 5));
    assert_eq!(pair.mapper.load(contents(), 8).unwrap(), 30);
    for chunk in pair.mapper.keyframe() {
        assert_eq!(chunk.info.epoch, 8);
        pair.follower.on_map(&chunk).unwrap();
    }
    pair.follow();
    assert_eq!(pair.occupied([0.0, 29.0, 500.0]), [true, true, false]);
    let counts = |pair: &Pair| {
        let voxels = pair.mapper.list().sorted().into_iter();
        voxels.map(|(_, v)| v.count).sum::<u32>()
    };
    assert_eq!(counts(&pair), counts(&source));
    // And the map goes on.
    pair.insert(2, &row(30, 5));
    assert_eq!(pair.mapper.list().len(), 35);

    let refused = |options: MapperOptions| {
        let mut pair = Pair::new(options);
        pair.insert(1, &row(500, 5));
        let refusal = pair.mapper.load(contents(), 8).unwrap_err();
        assert_eq!((pair.mapper.list().len(), pair.mapper.state().0), (5, 7));
        pair.insert(2, &row(600, 5));
        refusal
    };
    let refusal = refused(options(LatticeKind::Bcc));
    assert!(matches!(refusal, LoadRefusal::Lattice { .. }), "{refusal}");
    let refusal = refused(MapperOptions {
        max_voxels: 29,
        ..options(LatticeKind::Fcc)
    });
    let too_many = matches!(refusal, LoadRefusal::TooMany { voxels: 30, .. });
    assert!(too_many, "{refusal}");
    let aged = MapperOptions {
        forget_after_ns: SECOND_NS,
        ..options(LatticeKind::Fcc)
    };
    assert!(matches!(refused(aged.clone()), LoadRefusal::Stamps));

    // With stamps it goes into either, and ages on.
    let mut source = Pair::new(aged.clone());
    source.insert(1, &row(0, 30));
    let mut pair = Pair::new(options(LatticeKind::Fcc));
    assert_eq!(pair.mapper.load(source.mapper.contents(), 8).unwrap(), 30);
    assert!(pair.mapper.list().payload().is_plain());
    let mut pair = Pair::new(aged);
    assert_eq!(pair.mapper.load(source.mapper.contents(), 8).unwrap(), 30);
    let late = cloud("map", 9 * SECOND_NS, &row(50, 1));
    for _ in 0..2 {
        pair.mapper.on_cloud(&late).unwrap();
    }
    assert_eq!(pair.mapper.list().len(), 1);
}
