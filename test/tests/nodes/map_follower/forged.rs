//! Updates and keyframes of somebody else: noticed by the next of the mapper, and healed.

use lattice_core::lattice::LatticeKind;
use lattice_msgs::builtin_interfaces::Time;
use lattice_nodes::lattice_mapper::LatticeMapper;
use lattice_nodes::map_follower::{Followed, MapFollower};
use lattice_test::clouds::cloud;
use lattice_test::maps::{self, follow_keyframe, follow_update, insert};

use super::{assert_asks, assert_same, follow, mapper, scatter};

#[test]
fn a_forged_update_is_noticed_and_the_map_healed() {
    let mut mapper = mapper(LatticeKind::Fcc);
    let mut follower = maps::follower(&mut mapper);
    insert(&mut mapper, &scatter(1, 500, [0.0; 3], 9.0));
    follow_update(&mut follower, &mut mapper);
    let heal = |follower: &mut MapFollower, mapper: &mut LatticeMapper, differences| {
        assert_eq!(follower.differences(), differences);
        follow_keyframe(follower, mapper);
        insert(mapper, &scatter(differences, 500, [7.0; 3], 9.0));
        follow_update(follower, mapper);
        assert_same(follower, mapper);
        assert_eq!(follower.differences(), differences);
    };
    insert(&mut mapper, &scatter(2, 500, [3.0; 3], 9.0));
    let genuine = mapper.take_update();
    // Another content under the next number.
    let mut forged = genuine[0].clone();
    forged.counts[0] += 1;
    assert_eq!(follower.on_update(&forged).unwrap(), Followed::NeedKeyframe);
    heal(&mut follower, &mut mapper, 1);
    // The last number there is, with and without its checksum.
    forged.previous_sequence = follower.sequence().unwrap();
    forged.sequence = u64::MAX;
    assert_eq!(follower.on_update(&forged).unwrap(), Followed::NeedKeyframe);
    heal(&mut follower, &mut mapper, 2);
    let mut keyframe = mapper.keyframe();
    keyframe
        .iter_mut()
        .for_each(|chunk| chunk.sequence = u64::MAX);
    follow(&mut follower, &keyframe);
    let mut asked = 0;
    while follower.differences() == 2 {
        insert(&mut mapper, &scatter(3, 5, [3.0; 3], 9.0));
        for chunk in mapper.take_update() {
            follower.on_update(&chunk).unwrap();
        }
        asked += 1;
        assert!(asked < 1000, "frozen");
    }
    heal(&mut follower, &mut mapper, 3);
    // A number of voxels that is not the mapper's.
    insert(&mut mapper, &scatter(4, 50, [30.0; 3], 9.0));
    let mut update = mapper.take_update();
    update[0].voxels_total += 1;
    assert_asks(&mut follower, &update);
    heal(&mut follower, &mut mapper, 4);
}

#[test]
fn a_forged_keyframe_is_noticed_by_the_next_update() {
    for ahead in [1, 3, 100, 1 << 40] {
        for stamp in [Time::default(), Time { sec: 0, nanosec: 1 }] {
            let mut mapper = mapper(LatticeKind::Fcc);
            let mut follower = maps::follower(&mut mapper);
            let mut map = |second: u64| {
                let points = scatter(second, 500, [second as f32; 3], 9.0);
                let message = cloud("map", second as i64 * 1_000_000_000, &points);
                mapper.on_cloud(&message).unwrap();
                mapper.take_update()
            };
            for chunk in map(1) {
                assert_eq!(follower.on_update(&chunk).unwrap(), Followed::Applied);
            }
            // Another content under a number that is not yet given.
            let mut forged = maps::mapper(maps::options(LatticeKind::Fcc, 0.125));
            insert(&mut forged, &scatter(9, 50_000, [50.0; 3], 90.0));
            for mut chunk in forged.keyframe() {
                chunk.sequence = follower.sequence().unwrap() + ahead;
                chunk.header.stamp = stamp;
                assert_eq!(follower.on_map(&chunk).unwrap(), Followed::Applied);
            }
            assert_asks(&mut follower, &map(2));
            assert_eq!(follower.differences(), 1, "{ahead}");
            follow_keyframe(&mut follower, &mut mapper);
            assert_same(&follower, &mapper);
        }
    }
}

#[test]
fn a_forged_keyframe_of_a_time_to_come_is_noticed_within_seconds() {
    for ahead in [3, 1 << 40] {
        let mut mapper = mapper(LatticeKind::Fcc);
        let mut follower = maps::follower(&mut mapper);
        let mut forged = maps::mapper(maps::options(LatticeKind::Fcc, 0.125));
        insert(&mut forged, &scatter(9, 50_000, [50.0; 3], 90.0));
        for mut chunk in forged.keyframe() {
            chunk.sequence = ahead;
            chunk.header.stamp = Time::from_ns(i64::MAX);
            assert_eq!(follower.on_map(&chunk).unwrap(), Followed::Applied);
        }
        // An update a second: at first they may be those of before that keyframe.
        let mut seconds = 0;
        while follower.differences() == 0 {
            assert!(seconds < 7, "not noticed");
            seconds += 1;
            follower.check_keyframe_timeout();
            insert(&mut mapper, &scatter(seconds, 5, [3.0; 3], 9.0));
            let update = mapper.take_update();
            follower.on_update(&update[0]).unwrap();
        }
        follow_keyframe(&mut follower, &mut mapper);
        assert_same(&follower, &mapper);
        assert_eq!(follower.differences(), 1);
    }
}

#[test]
fn updates_that_a_keyframe_has_overtaken_are_no_forgery() {
    let mut mapper = mapper(LatticeKind::Fcc);
    let mut follower = maps::follower(&mut mapper);
    let mut overtaken = Vec::new();
    for second in 1..20_u64 {
        let points = scatter(second, 500, [second as f32; 3], 9.0);
        let message = cloud("map", second as i64 * 1_000_000_000, &points);
        mapper.on_cloud(&message).unwrap();
        overtaken.extend(mapper.take_update());
    }
    follow_keyframe(&mut follower, &mut mapper);
    for chunk in &overtaken {
        assert_eq!(follower.on_update(chunk).unwrap(), Followed::Old);
    }
    assert_eq!(follower.differences(), 0);
    assert_same(&follower, &mapper);
}
