//! Those who follow a map: deltas, keyframes, late joining, gaps, hostile input.

use lattice_core::lattice::LatticeKind;
use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};
use lattice_nodes::hurry::Hurry;
use lattice_nodes::lattice_mapper::{LatticeMapper, MapperOptions};
use lattice_nodes::map_follower::{Followed, MapFollower};
use lattice_test::maps::{self, follow_keyframe, follow_update, insert};
use proptest::prelude::*;

mod forged;

pub fn mapper(kind: LatticeKind) -> LatticeMapper {
    maps::mapper(maps::options(kind, 0.125))
}

fn new() -> MapFollower {
    MapFollower::new(1_000_000)
}

/// A deterministic cloud of `n` points about `at`, `size` metres wide.
pub fn scatter(seed: u64, n: usize, at: [f32; 3], size: f32) -> Vec<[f32; 3]> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        ((state >> 40) as f32 / (1u64 << 24) as f32 - 0.5) * size
    };
    (0..n).map(|_| at.map(|v| v + next())).collect()
}

/// Gives a follower chunks of a keyframe.
fn follow(follower: &mut MapFollower, chunks: &[LatticeMap]) {
    for chunk in chunks {
        assert_eq!(follower.on_map(chunk).unwrap(), Followed::Applied);
    }
}

/// The first chunk of an update shows that something was lost.
fn assert_asks(follower: &mut MapFollower, update: &[LatticeMapUpdate]) {
    let followed = follower.on_update(&update[0]).unwrap();
    assert_eq!(followed, Followed::NeedKeyframe);
}

/// The follower has exactly the mapper's voxels.
pub fn assert_same(follower: &MapFollower, mapper: &LatticeMapper) {
    let map = follower.map().unwrap();
    let list = mapper.list();
    assert_eq!(map.voxels().len(), list.len());
    for (key, voxel) in list.sorted() {
        let state = map.voxels()[&key];
        assert_eq!(state.count, voxel.count);
        let mean_m = voxel.mean_offset_m();
        for (sent, mean_m) in state.mean_offset.iter().zip(mean_m) {
            let sent_m = f64::from(*sent) * map.offset_unit_m;
            assert!((sent_m - mean_m).abs() <= map.offset_unit_m);
        }
        assert!((map.center_m(key) - list.center_m(key)).norm() < 1e-9);
    }
}

#[test]
fn a_follower_of_deltas_has_the_same_voxels() {
    for kind in LatticeKind::ALL {
        let mut mapper = mapper(kind);
        let mut follower = maps::follower(&mut mapper);
        for step in 0..10 {
            let points = scatter(step, 2000, [step as f32, 0.0, 0.0], 8.0);
            insert(&mut mapper, &points);
            follow_update(&mut follower, &mut mapper);
            assert_same(&follower, &mapper);
        }
        assert_eq!(follower.sequence(), Some(10));
    }
}

#[test]
fn a_follower_that_has_to_end_leaves_keyframes_out_and_takes_updates() {
    let mut mapper = mapper(LatticeKind::Fcc);
    let hurry = Hurry::default();
    let mut follower = new().hurried_by(&hurry);
    follow(&mut follower, &mapper.keyframe());
    insert(&mut mapper, &scatter(1, 20_000, [0.0; 3], 100.0));
    let update = mapper.take_update();
    let keyframe = mapper.keyframe();
    hurry.request();
    for chunk in &keyframe {
        assert_eq!(follower.on_map(chunk).unwrap(), Followed::LeftOut);
    }
    assert_eq!(follower.sequence(), Some(0));
    for chunk in &update {
        assert_eq!(follower.on_update(chunk).unwrap(), Followed::Applied);
    }
    assert_same(&follower, &mapper);
}

/// A chunk of an update that never becomes complete fills no memory, however often it comes.
#[test]
fn a_repeated_chunk_is_kept_once() {
    let mut mapper = mapper(LatticeKind::Fcc);
    let mut follower = maps::follower(&mut mapper);
    insert(&mut mapper, &scatter(1, 1000, [0.0; 3], 100.0));
    let mut chunk = mapper.take_update().swap_remove(0);
    chunk.chunks += 1;
    for count in 1..300 {
        chunk.counts.fill(count);
        follower.on_update(&chunk).unwrap();
    }
    let (touched, _) = follower.take_touched();
    let keys: std::collections::BTreeSet<_> = touched.iter().collect();
    assert!(keys.len() >= 500, "{}", keys.len());
    assert!(touched.len() <= 1 << 16, "{}", touched.len());
}

#[test]
fn a_late_joiner_takes_the_keyframe_and_then_deltas() {
    let mut mapper = mapper(LatticeKind::Bcc);
    insert(&mut mapper, &scatter(1, 20_000, [0.0; 3], 100.0));
    mapper.take_update();
    let mut follower = new();
    insert(&mut mapper, &scatter(2, 500, [0.0; 3], 10.0));
    let early = mapper.take_update();
    assert_asks(&mut follower, &early);
    let keyframe = mapper.keyframe();
    let (first, rest) = keyframe.split_at(2);
    follow(&mut follower, first);
    let voxels = follower.map().unwrap().voxels();
    assert!(voxels.is_empty(), "half a map is no map");
    insert(&mut mapper, &scatter(3, 500, [20.0, 0.0, 0.0], 10.0));
    for chunk in mapper.take_update() {
        follower.on_update(&chunk).unwrap();
    }
    follow(&mut follower, rest);
    assert_same(&follower, &mapper);
}

#[test]
fn a_lost_update_is_noticed_and_a_keyframe_heals_it() {
    let mut mapper = mapper(LatticeKind::Mcc);
    let mut follower = maps::follower(&mut mapper);
    insert(&mut mapper, &scatter(1, 100, [0.0; 3], 5.0));
    mapper.take_update();
    insert(&mut mapper, &scatter(2, 100, [50.0, 0.0, 0.0], 5.0));
    let next = mapper.take_update();
    assert_asks(&mut follower, &next);
    follow_keyframe(&mut follower, &mut mapper);
    assert_same(&follower, &mapper);
    insert(&mut mapper, &scatter(3, 100, [0.0; 3], 5.0));
    follow_update(&mut follower, &mut mapper);
    assert_same(&follower, &mapper);
}

/// A mapper with a map of several chunks, and a follower that has all of it.
fn followed() -> (LatticeMapper, MapFollower) {
    let mut mapper = mapper(LatticeKind::Fcc);
    insert(&mut mapper, &scatter(1, 20_000, [0.0; 3], 100.0));
    mapper.take_update();
    let follower = maps::follower(&mut mapper);
    assert_same(&follower, &mapper);
    (mapper, follower)
}

fn grown(mapper: &mut LatticeMapper, seed: u64) -> Vec<LatticeMapUpdate> {
    let at = [200.0 + seed as f32, 0.0, 0.0];
    insert(mapper, &scatter(seed, 50, at, 5.0));
    mapper.take_update()
}

#[test]
fn a_keyframe_that_updates_overtake_does_not_hide_later_losses() {
    let (mut mapper, mut follower) = followed();
    let update = grown(&mut mapper, 2);
    let keyframe = mapper.keyframe();
    assert!(keyframe.len() > 1);
    follow(&mut follower, &keyframe[..1]);
    for chunk in update {
        assert_eq!(follower.on_update(&chunk).unwrap(), Followed::Applied);
    }
    for chunk in &keyframe[1..] {
        assert_eq!(follower.on_map(chunk).unwrap(), Followed::Old);
    }
    assert_same(&follower, &mapper);
    grown(&mut mapper, 3);
    let after_a_loss = grown(&mut mapper, 4);
    assert_asks(&mut follower, &after_a_loss);
}

#[test]
fn an_update_before_the_keyframe_that_heals_is_not_taken_for_done() {
    let (mut mapper, mut follower) = followed();
    grown(&mut mapper, 2);
    let keyframe = mapper.keyframe();
    let early = grown(&mut mapper, 3);
    assert_asks(&mut follower, &early);
    follow(&mut follower, &keyframe);
    // The update came before the keyframe was begun, so it must come again.
    let after = grown(&mut mapper, 4);
    assert_asks(&mut follower, &after);
    follow_keyframe(&mut follower, &mut mapper);
    assert_same(&follower, &mapper);
}

#[test]
fn a_keyframe_of_which_a_chunk_was_lost_is_asked_for_again() {
    let mut mapper = mapper(LatticeKind::Fcc);
    insert(&mut mapper, &scatter(1, 20_000, [0.0; 3], 100.0));
    mapper.take_update();
    let mut follower = new();
    follow(&mut follower, &mapper.keyframe()[1..]);
    let mut asked = false;
    for seed in 2..20 {
        for chunk in grown(&mut mapper, seed) {
            asked |= follower.on_update(&chunk).unwrap() == Followed::NeedKeyframe;
        }
    }
    assert!(asked);
    follow_keyframe(&mut follower, &mut mapper);
    assert_same(&follower, &mapper);
}

#[test]
fn a_reset_map_replaces_the_old_one() {
    let mut mapper = mapper(LatticeKind::Hex);
    let mut follower = new();
    insert(&mut mapper, &scatter(1, 1000, [0.0; 3], 20.0));
    follow_keyframe(&mut follower, &mut mapper);
    mapper.reset(8);
    insert(&mut mapper, &scatter(2, 10, [0.0; 3], 2.0));
    follow_keyframe(&mut follower, &mut mapper);
    assert_same(&follower, &mapper);
}

/// A mapper of small chunks, with a map of about forty of them.
fn in_many_chunks() -> LatticeMapper {
    let mut mapper = maps::mapper(MapperOptions {
        chunk_bytes: 4096,
        ..maps::options(LatticeKind::Fcc, 0.125)
    });
    insert(&mut mapper, &scatter(1, 10_000, [0.0; 3], 100.0));
    mapper.take_update();
    mapper
}

#[test]
fn a_loaded_map_arrives_though_updates_come_between_its_chunks() {
    let mut mapper = in_many_chunks();
    let mut follower = maps::follower(&mut mapper);
    let contents = mapper.contents();
    mapper.load(contents, 8).unwrap();
    let keyframe = mapper.keyframe();
    follow(&mut follower, &keyframe[..1]);
    for chunk in grown(&mut mapper, 2) {
        assert_eq!(follower.on_update(&chunk).unwrap(), Followed::Applied);
    }
    let voxels = follower.map().unwrap().voxels();
    assert!(voxels.is_empty(), "half a map is no map");
    follow(&mut follower, &keyframe[1..]);
    assert_same(&follower, &mapper);
    assert_eq!(follower.sequence(), Some(1));
}

#[test]
fn a_keyframe_of_many_rounds_is_taken_without_asking_for_another() {
    let mut mapper = in_many_chunks();
    let keyframe = mapper.keyframe();
    assert!(keyframe.len() > 20, "{}", keyframe.len());
    let mut follower = new();
    for (seed, chunk) in (2..).zip(&keyframe) {
        assert_eq!(follower.on_map(chunk).unwrap(), Followed::Applied);
        assert!(!follower.check_keyframe_timeout());
        for update in grown(&mut mapper, seed) {
            assert_eq!(follower.on_update(&update).unwrap(), Followed::Applied);
        }
    }
    assert_same(&follower, &mapper);
}

/// Seconds in which nothing more comes, until the follower asks for a keyframe.
fn seconds_until_asked(follower: &mut MapFollower) -> Option<usize> {
    (1..100).find(|_| follower.check_keyframe_timeout())
}

#[test]
fn what_is_incomplete_on_an_idle_map_is_asked_for_again_and_ever_more_rarely() {
    let mut mapper = in_many_chunks();
    let keyframe = mapper.keyframe();
    let mut follower = new();
    assert_eq!(seconds_until_asked(&mut follower), None, "nothing has come");
    follow(&mut follower, &keyframe[1..]);
    for seconds in [3, 5, 9, 17, 33, 65, 65] {
        assert_eq!(seconds_until_asked(&mut follower), Some(seconds));
    }
    for chunk in &keyframe {
        follower.on_map(chunk).unwrap();
    }
    assert_same(&follower, &mapper);
    assert_eq!(seconds_until_asked(&mut follower), None);

    // An update of which a chunk is lost.
    insert(&mut mapper, &scatter(2, 2000, [200.0, 0.0, 0.0], 50.0));
    let update = mapper.take_update();
    assert!(update.len() > 1);
    follower.on_update(&update[0]).unwrap();
    assert_eq!(seconds_until_asked(&mut follower), Some(3));
    follow_keyframe(&mut follower, &mut mapper);
    assert_same(&follower, &mapper);
    assert_eq!(seconds_until_asked(&mut follower), None);
}

#[test]
fn a_map_too_large_to_keep_is_not_asked_for_with_every_update() {
    let mut mapper = in_many_chunks();
    let mut follower = MapFollower::new(mapper.list().len() - 1);
    assert!(follower.on_map(&mapper.keyframe()[0]).is_err());
    for chunk in grown(&mut mapper, 2) {
        assert_eq!(follower.on_update(&chunk).unwrap(), Followed::Old);
    }
}

/// One message of the map with one part of it made wrong.
fn damaged() -> impl Strategy<Value = (LatticeMap, LatticeMapUpdate)> {
    let mut mapper = mapper(LatticeKind::Fcc);
    insert(&mut mapper, &scatter(1, 300, [0.0; 3], 10.0));
    let update = mapper.take_update().remove(0);
    let map = mapper.keyframe().remove(0);
    (0..9, any::<u64>(), any::<Vec<u8>>()).prop_map(move |(what, number, bytes)| {
        let (mut map, mut update) = (map.clone(), update.clone());
        let word = number as u32;
        match what {
            0 => (map.chunk, update.chunk) = (word, word),
            1 => (map.chunks, update.chunks) = (word, word),
            2 => map.voxels_total = number,
            3 => {
                map.keys = serde_bytes::ByteBuf::from(bytes.clone());
                update.keys = serde_bytes::ByteBuf::from(bytes);
            }
            4 => {
                map.counts.truncate(number as usize % 100);
                update.counts.truncate(number as usize % 100);
            }
            5 => {
                map.mean_offsets.push(0);
                update.mean_offsets.push(0);
            }
            6 => {
                map.info.lattice = String::from_utf8_lossy(&bytes).into_owned();
                update.removed_keys = serde_bytes::ByteBuf::from(bytes);
            }
            7 => {
                map.info.cell_volume_m3 = f64::from_bits(number);
                map.info.map_from_lattice.position.x = f64::from_bits(number);
            }
            _ => {
                (map.sequence, update.sequence, update.previous_sequence) = (number, number, number)
            }
        }
        (map, update)
    })
}

proptest! {
    #[test]
    fn damaged_messages_never_panic_and_never_spoil_the_map((map, update) in damaged()) {
        let mut mapper = mapper(LatticeKind::Fcc);
        insert(&mut mapper, &scatter(1, 300, [0.0; 3], 10.0));
        let mut follower = MapFollower::new(10_000);
        follow_keyframe(&mut follower, &mut mapper);
        let _ = follower.on_map(&map);
        let _ = follower.on_update(&update);
        prop_assert!(follower.map().unwrap().voxels().len() <= 10_000);
        // A new epoch is always taken.
        mapper.reset(u64::MAX);
        insert(&mut mapper, &scatter(2, 300, [0.0; 3], 10.0));
        let mut good = mapper.keyframe();
        for chunk in &mut good {
            chunk.info.epoch = 12_345;
        }
        for chunk in &good {
            prop_assert_eq!(follower.on_map(chunk).unwrap(), Followed::Applied);
        }
        assert_same(&follower, &mapper);
    }
}
