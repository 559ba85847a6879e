//! Maps of several robots as one: exact sums in any order, and a robot that begins anew.

use std::collections::BTreeMap;

use lattice_core::lattice::{Lattice, LatticeKind, MortonKey};
use lattice_msgs::geographic_msgs::{GeoPoint, GeoPointStamped};
use lattice_nodes::lattice_mapper::{LatticeMapper, MapperOptions};
use lattice_nodes::map_follower::{Followed, MapFollower};
use lattice_nodes::map_merger::{MapMerger, MergedLabels, MergerOptions};
use lattice_test::maps::{self, insert};
use nalgebra::Vector3;
use proptest::prelude::*;

use super::map_follower::scatter;

fn options(robots: usize) -> MergerOptions {
    MergerOptions {
        robots: (0..robots).map(|i| format!("robot{i}")).collect(),
        map_frame: "map".to_owned(),
        datum_m: Vector3::zeros(),
        max_voxels: 1_000_000,
        labels: MergedLabels::None,
        chunk_bytes: 60_000,
    }
}

fn mapper(datum_near_m: [f64; 3]) -> LatticeMapper {
    maps::mapper(MapperOptions {
        datum_near_m: datum_near_m.into(),
        ..maps::options(LatticeKind::Fcc, 0.125)
    })
}

/// Gives the merger a robot's keyframe.
fn show(merger: &mut MapMerger, robot: usize, mapper: &mut LatticeMapper) {
    for chunk in mapper.keyframe() {
        assert_eq!(merger.on_map(robot, &chunk).unwrap(), Followed::Applied);
    }
}

/// Gives it what changed.
fn tell(merger: &mut MapMerger, robot: usize, mapper: &mut LatticeMapper) {
    for chunk in mapper.take_update() {
        assert_eq!(merger.on_update(robot, &chunk).unwrap(), Followed::Applied);
    }
}

/// Counts by place of the cells, in thousandths of a metre.
fn counts(voxels: impl Iterator<Item = (Vector3<f64>, u32)>) -> BTreeMap<[i64; 3], u32> {
    let place = |center: Vector3<f64>| <[f64; 3]>::from(center).map(|v| (v * 1e3).round() as i64);
    let mut found = BTreeMap::new();
    for (center, count) in voxels {
        *found.entry(place(center)).or_default() += count;
    }
    found
}

fn of_merger(merger: &MapMerger) -> BTreeMap<[i64; 3], u32> {
    let list = merger.list().unwrap();
    let voxels = list.sorted().into_iter();
    counts(voxels.map(|(key, voxel)| (list.center_m(key), voxel.count)))
}

fn of_mappers(mappers: &[&LatticeMapper]) -> BTreeMap<[i64; 3], u32> {
    let lists = mappers.iter().map(|mapper| mapper.list());
    counts(lists.flat_map(|list| {
        let voxels = list.sorted().into_iter();
        voxels.map(|(key, voxel): (MortonKey, _)| (list.center_m(key), voxel.count))
    }))
}

/// The cells and counts of a mapper, and its means: two units off at most, since each robot's is rounded
/// to one before they are summed up.
fn assert_close(follower: &MapFollower, mapper: &LatticeMapper) {
    let map = follower.map().unwrap();
    let list = mapper.list();
    assert_eq!(map.voxels().len(), list.len());
    for (key, voxel) in list.sorted() {
        let state = map.voxels()[&key];
        assert_eq!(state.count, voxel.count);
        for (sent, mean_m) in state.mean_offset.iter().zip(voxel.mean_offset_m()) {
            let off_m = f64::from(*sent) * map.offset_unit_m - mean_m;
            assert!(off_m.abs() <= 2.0 * map.offset_unit_m, "{off_m} m off");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Whatever the order of messages and of updates, followers have the map of one that received all.
    #[test]
    fn the_merged_map_is_that_of_one_mapper_that_heard_all(
        order in prop::collection::vec((0_usize..3, 0..3), 5..40),
    ) {
        let datums = [[0.0; 3], [7.0, -3.0, 1.0], [0.0; 3]];
        let mut robots = datums.map(mapper);
        let mut all = mapper([0.0; 3]);
        let mut merger = MapMerger::new(options(3), 70);
        for (i, robot) in robots.iter_mut().enumerate() {
            show(&mut merger, i, robot);
        }
        merger.take_update();
        let mut follower = MapFollower::new(1_000_000);
        for chunk in merger.keyframe() {
            follower.on_map(&chunk).unwrap();
        }
        for (seed, (robot, publishes)) in order.into_iter().enumerate() {
            let points = scatter(seed as u64, 300, [robot as f32, 0.0, 0.0], 6.0);
            insert(&mut robots[robot], &points);
            insert(&mut all, &points);
            tell(&mut merger, robot, &mut robots[robot]);
            if publishes > 0 {
                // At once over, or not.
                for chunk in merger.take_update_until(&|| publishes == 1) {
                    prop_assert_eq!(follower.on_update(&chunk).unwrap(), Followed::Applied);
                }
                prop_assert_eq!(merger.waiting() > 0, publishes == 1);
            }
        }
        for chunk in merger.take_update() {
            follower.on_update(&chunk).unwrap();
        }
        assert_close(&follower, &all);
    }
}

#[test]
fn the_share_of_a_robot_that_begins_anew_is_replaced_once_its_map_is_whole() {
    let mut robots = [mapper([0.0; 3]), mapper([0.0; 3])];
    let mut merger = MapMerger::new(options(2), 70);
    for (i, robot) in robots.iter_mut().enumerate() {
        insert(
            robot,
            &scatter(i as u64, 4000, [i as f32 * 4.0, 0.0, 0.0], 9.0),
        );
        show(&mut merger, i, robot);
    }
    merger.take_update();
    let before = of_merger(&merger);
    assert_eq!(before, of_mappers(&[&robots[0], &robots[1]]));
    // A new map in several chunks, of which the last is late.
    let mut again = LatticeMapper::new(
        MapperOptions {
            chunk_bytes: 3000,
            ..maps::options(LatticeKind::Fcc, 0.125)
        },
        8,
    )
    .unwrap();
    insert(&mut again, &scatter(9, 4000, [2.0, 1.0, 0.0], 9.0));
    let chunks = again.keyframe();
    let (last, first) = chunks.split_last().unwrap();
    assert!(!first.is_empty());
    for chunk in first {
        merger.on_map(1, chunk).unwrap();
    }
    // Cells of both robots change meanwhile.
    insert(&mut robots[0], &scatter(3, 4000, [4.0, 0.0, 0.0], 9.0));
    tell(&mut merger, 0, &mut robots[0]);
    merger.take_update();
    assert_eq!(of_merger(&merger), of_mappers(&[&robots[0], &robots[1]]));
    merger.on_map(1, last).unwrap();
    merger.take_update();
    assert_eq!(of_merger(&merger), of_mappers(&[&robots[0], &again]));
    assert_eq!(merger.counts().shares_replaced, 3);
}

#[test]
fn maps_that_do_not_go_together_are_left_out_with_the_numbers() {
    let lattice = |kind, volume_m3| Lattice::new(kind, volume_m3).unwrap();
    let fcc = lattice(LatticeKind::Fcc, 0.125);
    let others = [
        (MapperOptions::new(lattice(LatticeKind::Bcc, 0.125)), "bcc"),
        (MapperOptions::new(lattice(LatticeKind::Fcc, 0.25)), "0.25"),
        (
            MapperOptions {
                map_frame: "odom".to_owned(),
                ..MapperOptions::new(fcc)
            },
            "frame 'odom'",
        ),
    ];
    for (number, (other, expected)) in others.into_iter().enumerate() {
        let frame = other.map_frame.clone();
        let mut robots = [mapper([0.0; 3]), LatticeMapper::new(other, 9).unwrap()];
        let points = scatter(1, 500, [0.0; 3], 5.0);
        insert(&mut robots[0], &points);
        let cloud = lattice_test::clouds::cloud(&frame, 1, &points);
        robots[1].on_cloud(&cloud).unwrap();
        let mut merger = MapMerger::new(options(2), 70);
        for (i, robot) in robots.iter_mut().enumerate() {
            show(&mut merger, i, robot);
        }
        merger.take_update();
        let refusal = merger.robot_maps()[1].refusal().unwrap().to_string();
        assert!(refusal.contains(expected), "{number}: {refusal}");
        assert_eq!(of_merger(&merger), of_mappers(&[&robots[0]]));
    }
    // Another origin.
    let origin = |latitude| GeoPointStamped {
        position: GeoPoint {
            latitude,
            ..GeoPoint::default()
        },
        ..GeoPointStamped::default()
    };
    let mut robots = [mapper([0.0; 3]), mapper([0.0; 3])];
    let mut merger = MapMerger::new(options(2), 70);
    for (i, robot) in robots.iter_mut().enumerate() {
        robot.on_origin(&origin(i as f64));
        insert(robot, &scatter(1, 500, [0.0; 3], 5.0));
        show(&mut merger, i, robot);
        merger.take_update();
    }
    let refusal = merger.robot_maps()[1].refusal().unwrap().to_string();
    assert!(refusal.contains("origin"), "{refusal}");
}

#[test]
fn a_full_map_stays_and_says_so() {
    let mut robots = [mapper([0.0; 3]), mapper([0.0; 3])];
    let mut merger = MapMerger::new(
        MergerOptions {
            max_voxels: 300,
            ..options(2)
        },
        70,
    );
    for (i, robot) in robots.iter_mut().enumerate() {
        insert(
            robot,
            &scatter(i as u64, 200, [100.0 * i as f32, 0.0, 0.0], 40.0),
        );
        assert!(robot.list().len() > 150);
        show(&mut merger, i, robot);
    }
    merger.take_update();
    assert_eq!(merger.list().unwrap().len(), 300);
    let lost = robots[0].list().len() + robots[1].list().len() - 300;
    assert_eq!(merger.counts().voxels_list_full, lost as u64);
}

#[test]
fn labels_say_which_robot_saw_most_of_a_cell() {
    let mut robots = [mapper([0.0; 3]), mapper([0.0; 3])];
    let mut merger = MapMerger::new(
        MergerOptions {
            labels: MergedLabels::Robots,
            ..options(2)
        },
        70,
    );
    for (i, robot) in robots.iter_mut().enumerate() {
        insert(
            robot,
            &scatter(i as u64, 4000, [i as f32 * 4.0, 0.0, 0.0], 9.0),
        );
        show(&mut merger, i, robot);
    }
    merger.take_update();
    let mut follower = MapFollower::new(1_000_000);
    for chunk in merger.keyframe() {
        follower.on_map(&chunk).unwrap();
    }
    let count =
        |robot: usize, key: &MortonKey| robots[robot].list().get(*key).map_or(0, |v| v.count);
    let mut shared = 0;
    for (key, voxel) in follower.map().unwrap().voxels() {
        let [first, second] = [count(0, key), count(1, key)];
        assert_eq!(voxel.count, first + second);
        assert_eq!(
            voxel.label,
            u16::from(second > first),
            "{first} and {second}"
        );
        assert_eq!(voxel.label_count, first.max(second));
        shared += usize::from(first > 0 && second > 0);
    }
    assert!(shared > 50, "{shared}");
}
