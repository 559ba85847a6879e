//! Playing bags of a few messages.

use std::{fs, path::Path};

use super::*;
use crate::{
    BagWriter, Storage, TopicSpec, WriterOptions,
    tests::{cdr, spec},
};

const S: i64 = 1_000_000_000;
const T0_NS: i64 = 1_700_000_000 * S;

/// Messages at these whole seconds, on topics named with '!' for latched.
fn bag(folder: &Path, messages: &[(&str, i64)]) -> BagReader {
    let path = folder.join("bag");
    let options = WriterOptions {
        overwrite: true,
        ..WriterOptions::default()
    };
    let mut writer = BagWriter::create(&path, Storage::Mcap, options).unwrap();
    let mut names: Vec<&str> = messages.iter().map(|(name, _)| *name).collect();
    names.sort_unstable();
    names.dedup();
    for name in &names {
        writer
            .add_topic(spec(name.trim_end_matches('!'), name.ends_with('!')))
            .unwrap();
    }
    for (name, second) in messages {
        let topic = names.iter().position(|n| n == name).unwrap();
        writer
            .write(topic, T0_NS + second * S, &cdr(*second, 2))
            .unwrap();
    }
    writer.finish().unwrap();
    BagReader::open(&path).unwrap()
}

/// Up to `count` steps, in short.
fn play(player: &mut Player, count: usize) -> Vec<String> {
    let mut steps = Vec::new();
    while steps.len() < count {
        let at_s = player.due_ns() as f64 / S as f64;
        steps.push(match player.next().unwrap() {
            Step::Publish { topic, .. } => format!("{} {at_s}", player.topics()[topic].info.name),
            Step::Clock(ns) => format!("clock {}", (ns - T0_NS) as f64 / S as f64),
            Step::Looped => "looped".into(),
            Step::End => {
                steps.push("end".into());
                break;
            }
        });
    }
    steps
}

/// Steps of a bag of these messages, up to `count`.
fn played(messages: &[(&str, i64)], options: PlayerOptions, count: usize) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    let mut player = Player::new(bag(folder.path(), messages), options).unwrap();
    let steps = play(&mut player, count);
    if steps.last().is_some_and(|step| step == "end") {
        assert_eq!(player.next().unwrap(), Step::End);
    }
    steps
}

fn options() -> PlayerOptions {
    PlayerOptions::default()
}

#[test]
fn messages_are_due_at_the_rate() {
    let twice = PlayerOptions {
        rate: 2.0,
        ..options()
    };
    let steps = played(&[("/a", 0), ("/b", 1), ("/a", 4)], twice, 9);
    assert_eq!(steps, ["/a 0", "/b 0.5", "/a 2", "end"]);
}

#[test]
fn latched_messages_before_the_start_come_first() {
    let messages = [
        ("/l!", 0),
        ("/m!", 0),
        ("/a", 1),
        ("/l!", 2),
        ("/a", 3),
        ("/a", 5),
        ("/l!", 6),
    ];
    let late = PlayerOptions {
        start_offset_s: 3.0,
        ..options()
    };
    // Of /l only the last one before the start: its publisher kept one.
    assert_eq!(
        played(&messages, late.clone(), 9),
        ["/m 0", "/l 0", "/a 0", "/a 2", "/l 3", "end"]
    );
    let only = PlayerOptions {
        exclude: vec!["/m".into()],
        duration_s: Some(2.0),
        ..late
    };
    assert_eq!(played(&messages, only, 9), ["/l 0", "/a 0", "end"]);
}

#[test]
fn all_publishers_of_a_latched_topic_are_heard() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bag");
    let mut writer = BagWriter::create(&path, Storage::Sqlite3, WriterOptions::default()).unwrap();
    let mut latched = spec("/tf_static", true);
    latched.offered_qos.extend(latched.offered_qos.clone());
    writer.add_topic(latched).unwrap();
    writer.add_topic(spec("/a", false)).unwrap();
    for (topic, second) in [(0, 0), (0, 1), (0, 2), (0, 3), (1, 9)] {
        let data = cdr(second, 2);
        writer.write(topic, T0_NS + second * S, &data).unwrap();
    }
    writer.finish().unwrap();
    let options = PlayerOptions {
        start_offset_s: 8.0,
        ..options()
    };
    let mut player = Player::new(BagReader::open(&path).unwrap(), options).unwrap();
    let Step::Publish { data, .. } = player.next().unwrap() else {
        panic!()
    };
    assert_eq!(data, cdr(2, 2));
    assert_eq!(play(&mut player, 9), ["/tf_static 0", "/a 1", "end"]);
}

#[test]
fn loops_go_on_in_playback_time() {
    let looped = |messages: &[(&str, i64)], count| {
        let options = PlayerOptions {
            loop_: true,
            ..options()
        };
        played(messages, options, count)
    };
    assert_eq!(
        looped(&[("/a", 0), ("/a", 2)], 7),
        ["/a 0", "/a 2", "looped", "/a 2", "/a 4", "looped", "/a 4"]
    );
    // A single message does not spin, and nothing at all does not loop.
    let single = ["/a 0", "looped", "/a 0.1", "looped"];
    assert_eq!(looped(&[("/a", 0)], 4), single);
    assert_eq!(looped(&[], 4), ["end"]);
}

#[test]
fn the_clock_ticks_between_messages() {
    let slow = PlayerOptions {
        clock_hz: Some(1.0),
        rate: 0.5,
        ..options()
    };
    let steps = played(&[("/a", 0), ("/a", 2)], slow, 20).join(", ");
    let expected = "clock 0, /a 0, clock 0.5, clock 1, clock 1.5, clock 2, /a 4, end";
    assert_eq!(steps, expected);
}

#[test]
fn topics_are_chosen_and_wrong_options_refused() {
    let folder = tempfile::tempdir().unwrap();
    let reader = bag(folder.path(), &[("/a", 0), ("/b", 1), ("/c", 2)]);
    let chosen = PlayerOptions {
        include: Some(vec!["/a".into(), "/b".into()]),
        exclude: vec!["/b".into()],
        ..options()
    };
    let mut player = Player::new(reader.clone(), chosen).unwrap();
    assert_eq!(play(&mut player, 9), ["/a 0", "end"]);
    let wrong: [fn(&mut PlayerOptions); 8] = [
        |o| o.include = Some(vec!["/x".into()]),
        |o| o.exclude = vec!["/x".into()],
        |o| o.rate = 0.0,
        |o| o.rate = f64::NAN,
        |o| o.start_offset_s = 3.0,
        |o| o.start_offset_s = -1.0,
        |o| o.duration_s = Some(f64::INFINITY),
        |o| o.clock_hz = Some(0.0),
    ];
    for (number, set) in wrong.iter().enumerate() {
        let mut options = options();
        set(&mut options);
        let refused = Player::new(reader.clone(), options);
        let is_refused = matches!(refused, Err(BagError::Invalid { .. }));
        assert!(is_refused, "{number}");
    }
}

#[test]
fn a_truncated_bag_plays_up_to_the_cut_and_then_tells() {
    let folder = tempfile::tempdir().unwrap();
    bag(folder.path(), &[("/a", 0), ("/a", 1)]);
    let file = folder.path().join("bag/bag_0.mcap");
    let whole = fs::read(&file).unwrap();
    // The data section ends with the first metadata record, written last.
    let place = whole.windows(7).position(|w| w == b"rosbag2").unwrap();
    fs::write(&file, &whole[..place]).unwrap();
    let mut player = Player::new(BagReader::open(&file).unwrap(), options()).unwrap();
    assert_eq!(play(&mut player, 2), ["/a 0", "/a 1"]);
    assert!(matches!(
        player.next(),
        Err(BagError::Truncated {
            readable_messages: 2,
            ..
        })
    ));
    assert_eq!(player.next().unwrap(), Step::End);
}

#[test]
fn a_truncated_bag_is_sought_in_as_a_whole_one() {
    let folder = tempfile::tempdir().unwrap();
    bag(folder.path(), &[("/map!", 0), ("/a", 1), ("/a", 3)]);
    let file = folder.path().join("bag/bag_0.mcap");
    let whole = fs::read(&file).unwrap();
    let place = whole.windows(7).position(|w| w == b"rosbag2").unwrap();
    fs::write(&file, &whole[..place]).unwrap();
    let mut player = Player::new(BagReader::open(&file).unwrap(), options()).unwrap();
    assert!(player.seek(10 * S, T0_NS + 2 * S).unwrap());
    assert_eq!(play(&mut player, 2), ["/map 10", "/a 11"]);
    assert!(matches!(player.next(), Err(BagError::Truncated { .. })));
}

#[test]
fn a_loop_goes_on_after_a_place_behind_the_last_message() {
    let folder = tempfile::tempdir().unwrap();
    let bag = bag(folder.path(), &[("/map!", 0), ("/a", 4)]);
    let looped = PlayerOptions {
        loop_: true,
        include: Some(vec!["/map".into()]),
        ..options()
    };
    let mut player = Player::new(bag, looped).unwrap();
    assert!(player.seek(0, T0_NS + 2 * S).unwrap());
    let steps = play(&mut player, 3);
    assert_eq!((&*steps[0], &*steps[1]), ("/map 0", "looped"));
    assert!(steps[2].starts_with("/map"), "{steps:?}");
}

#[test]
fn a_file_beside_its_compressed_form_is_read_once() {
    let folder = tempfile::tempdir().unwrap();
    bag(folder.path(), &[("/a", 0), ("/a", 1)]);
    let path = folder.path().join("bag");
    fs::remove_file(path.join("metadata.yaml")).unwrap();
    let packed = zstd::encode_all(&fs::read(path.join("bag_0.mcap")).unwrap()[..], 0).unwrap();
    fs::write(path.join("bag_0.mcap.zstd"), packed).unwrap();
    let mut player = Player::new(BagReader::open(&path).unwrap(), options()).unwrap();
    assert_eq!(play(&mut player, 9), ["/a 0", "/a 1", "end"]);
}

#[test]
fn the_rate_changes_from_now_on() {
    let folder = tempfile::tempdir().unwrap();
    let bag = bag(folder.path(), &[("/a", 0), ("/a", 2), ("/a", 6)]);
    let mut player = Player::new(bag, options()).unwrap();
    player.next().unwrap();
    assert!(player.set_rate(S, 2.0));
    assert_eq!(player.rate(), 2.0);
    // One of two seconds has passed.
    assert_eq!(play(&mut player, 3), ["/a 1.5", "/a 3.5", "end"]);
    for rate in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e4] {
        assert!(!player.set_rate(4 * S, rate));
    }
    assert_eq!(player.rate(), 2.0);
}

#[test]
fn a_sought_time_is_played_from_with_what_was_latched() {
    let folder = tempfile::tempdir().unwrap();
    let bag = bag(
        folder.path(),
        &[("/map!", 0), ("/a", 1), ("/a", 3), ("/a", 4)],
    );
    let clock = PlayerOptions {
        clock_hz: Some(1.0),
        ..options()
    };
    let mut player = Player::new(bag, clock).unwrap();
    assert_eq!(play(&mut player, 20).last().unwrap(), "end");
    // From after the end back, and on.
    assert!(player.seek(10 * S, T0_NS + 2 * S).unwrap());
    let steps = [
        "clock 2", "/map 10", "clock 3", "/a 11", "clock 4", "/a 12", "end",
    ];
    assert_eq!(play(&mut player, 20), steps);
    for second in [-1, 5] {
        assert!(!player.seek(20 * S, T0_NS + second * S).unwrap());
    }
    assert_eq!(player.next().unwrap(), Step::End);
}

#[test]
fn a_message_ahead_of_its_time_takes_the_time_along() {
    let folder = tempfile::tempdir().unwrap();
    let bag = bag(folder.path(), &[("/a", 0), ("/a", 5), ("/a", 6)]);
    let clock = PlayerOptions {
        clock_hz: Some(10.0),
        ..options()
    };
    let mut player = Player::new(bag, clock).unwrap();
    for second in [0, 5] {
        assert!(player.skip_to_next(S).unwrap().is_some());
        assert_eq!(player.bag_time_ns(S), T0_NS + second * S);
    }
    let last = play(&mut player, 20);
    assert_eq!(last[last.len() - 2..], ["/a 2", "end"]);
    assert_eq!(player.skip_to_next(3 * S).unwrap(), None);
}

/// A log of static transforms, recorded as volatile, at these seconds with these contents, and of `/a` at 0 to 9 s.
fn statics(folder: &Path, namespace: &str, messages: &[(i64, i64)]) -> BagReader {
    let path = folder.join("bag");
    let options = WriterOptions {
        overwrite: true,
        ..WriterOptions::default()
    };
    let mut writer = BagWriter::create(&path, Storage::Mcap, options).unwrap();
    let transforms = TopicSpec {
        type_name: "tf2_msgs/msg/TFMessage".into(),
        ..spec(&format!("{namespace}/tf_static"), false)
    };
    writer.add_topic(transforms).unwrap();
    writer.add_topic(spec("/a", false)).unwrap();
    for second in 0..10 {
        writer.write(1, T0_NS + second * S, &cdr(0, 2)).unwrap();
    }
    for (second, content) in messages {
        let data = cdr(*content, 2);
        writer.write(0, T0_NS + second * S + 1, &data).unwrap();
    }
    writer.finish().unwrap();
    BagReader::open(&path).unwrap()
}

/// Contents of the static transforms that are given at a place in the log, before its own messages.
fn given(reader: BagReader, start_offset_s: f64) -> Vec<Vec<u8>> {
    let options = PlayerOptions {
        start_offset_s,
        ..options()
    };
    let mut player = Player::new(reader, options).unwrap();
    let mut found = Vec::new();
    loop {
        match player.next().unwrap() {
            Step::Publish { topic, data } if player.topics()[topic].info.name != "/a" => {
                found.push(data);
            }
            _ => return found,
        }
    }
}

#[test]
fn static_transforms_hold_from_the_beginning_whatever_their_qos() {
    let folder = tempfile::tempdir().unwrap();
    let contents = |of: &[i64]| {
        of.iter()
            .map(|content| cdr(*content, 2))
            .collect::<Vec<_>>()
    };
    for namespace in ["", "/robot"] {
        // The earliest last, so that of one frame its first value holds at the beginning.
        let all = [(3, 30), (5, 50), (5, 50), (7, 70)];
        let reader = statics(folder.path(), namespace, &all);
        assert!(reader.topics()[0].is_latched());
        assert_eq!(given(reader.clone(), 0.0), contents(&[70, 50, 30]));
        // What was sent before the place holds over what comes.
        assert_eq!(given(reader.clone(), 4.0), contents(&[70, 50, 30]));
        assert_eq!(given(reader, 9.0), contents(&[30, 50, 50, 70]));
    }
    // No more than a listener keeps.
    let many: Vec<(i64, i64)> = (0..300).map(|i| (1, i)).collect();
    let reader = statics(folder.path(), "", &many);
    let found = given(reader, 0.0);
    assert!(
        found.len() <= 100 && found.last() == Some(&cdr(0, 2)),
        "{}",
        found.len()
    );
}
