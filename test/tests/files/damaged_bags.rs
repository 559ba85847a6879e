//! Bags with random damage, recovered beside an independent program that reads them message by message.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;

use lattice_bag::{
    BagReader, BagWriter, ReadOptions, Recovered, Storage, TopicSpec, WriterOptions, recover,
};
use lattice_test::python::{python, script};
use lattice_test::random::Random;

use super::bags::hash;

const MESSAGES: usize = 700;
/// Damage of a file's magic alone, whose name still names the storage.
const FIRST_BYTES: &str = "first bytes";
const START_NS: i64 = 1_700_000_000_000_000_000;

/// Topic, log time, number of bytes and their hash.
type Message = (String, i64, usize, u64);

/// Clouds of 20 kB, and an IMU ten times as often.
fn write(bag: &Path, storage: Storage, random: &mut Random) -> BTreeSet<Message> {
    let mut writer = BagWriter::create(bag, storage, WriterOptions::default()).unwrap();
    for name in ["/imu", "/points"] {
        let topic = TopicSpec {
            name: name.into(),
            type_name: "std_msgs/msg/String".into(),
            definition: Some("string data\n".into()),
            ..TopicSpec::default()
        };
        writer.add_topic(topic).unwrap();
    }
    let mut written = BTreeSet::new();
    for i in 0..MESSAGES {
        let (topic, name, bytes) = match i % 10 {
            0 => (1, "/points", 20_000),
            _ => (0, "/imu", 300),
        };
        let content = (0..bytes).map(|_| random.below(256) as u8);
        let data: Vec<u8> = [0, 1, 0, 0].into_iter().chain(content).collect();
        let time_ns = START_NS + i as i64 * 10_000_000;
        writer.write(topic, time_ns, &data).unwrap();
        written.insert((name.to_owned(), time_ns, data.len(), hash(&data)));
    }
    writer.finish().unwrap();
    written
}

/// One to three flipped bits, a sector or page of zeros or of noise, a cut, or noise in the first bytes.
fn damage(bytes: &mut Vec<u8>, random: &mut Random) -> String {
    let at = random.below(bytes.len());
    let mut fill = |from: usize, count: usize, noise: bool| {
        for byte in bytes.iter_mut().skip(from).take(count) {
            *byte = if noise { random.below(256) as u8 } else { 0 };
        }
    };
    match at % 7 {
        0 | 1 => {
            let flips = 1 + at % 3;
            for _ in 0..flips {
                let at = random.below(bytes.len());
                bytes[at] ^= 1 << random.below(8);
            }
            format!("{flips} bits")
        }
        2 => {
            fill(at, 512, false);
            format!("zeros at {at}")
        }
        3 => {
            fill(at - at % 4096, 4096, false);
            format!("a page of zeros at {at}")
        }
        4 => {
            fill(at, 512, true);
            format!("noise at {at}")
        }
        5 => {
            bytes.truncate(at);
            format!("cut at {at}")
        }
        _ => {
            fill(0, 8, true);
            FIRST_BYTES.into()
        }
    }
}

fn read(bag: &Path) -> Vec<Message> {
    let Ok(reader) = BagReader::open(bag) else {
        return Vec::new();
    };
    let message = |message: lattice_bag::BagMessage| {
        let name = reader.topics()[message.topic].name.clone();
        (
            name,
            message.log_time_ns,
            message.data.len(),
            hash(&message.data),
        )
    };
    let messages = reader.messages(&ReadOptions::default()).unwrap();
    messages.map(|found| message(found.unwrap())).collect()
}

/// Sums over all damages.
#[derive(Debug, Default)]
struct Sums {
    damages: usize,
    recovered: usize,
    by_peer: usize,
    unchecked: usize,
    altered: usize,
    opened: usize,
    lost: u64,
    missing: u64,
    uncounted: Vec<String>,
}

/// Recovers a bag with each damage, in turn with and without its metadata.
fn compare(storage: Storage, damages: usize) {
    let Some(python) = python() else {
        return;
    };
    let mut random = Random(11);
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole");
    let written = write(&whole, storage, &mut random);
    let name = format!("whole_0.{}", storage.extension());
    let bytes = fs::read(whole.join(&name)).unwrap();
    let mut sums = Sums::default();
    for number in 0..damages {
        let bag = folder.path().join(format!("damaged{number}"));
        let out = folder.path().join(format!("out{number}"));
        fs::create_dir(&bag).unwrap();
        let mut bent = bytes.clone();
        let how = damage(&mut bent, &mut random);
        fs::write(bag.join(&name), bent).unwrap();
        if number % 2 == 0 {
            fs::copy(whole.join("metadata.yaml"), bag.join("metadata.yaml")).unwrap();
        }
        let peer = Command::new(&python)
            .arg(script("damaged_bags.py"))
            .args([&MESSAGES.to_string(), bag.join(&name).to_str().unwrap()])
            .output()
            .unwrap();
        assert!(
            peer.status.success(),
            "{}",
            String::from_utf8_lossy(&peer.stderr)
        );
        let by_peer: Vec<Message> = serde_json::from_slice(&peer.stdout).unwrap();
        let by_peer = by_peer.iter().filter(|m| written.contains(m)).count();
        let recovered = recover(&bag, &out);
        let found = read(&out);
        let sound = found.iter().filter(|m| written.contains(m)).count();
        let shown = format!("{storage:?} {number}: {how}: {sound}, peer {by_peer}, {recovered:?}");
        assert!(sound >= by_peer, "{shown}");
        assert!(how != FIRST_BYTES || sound == MESSAGES, "{shown}");
        let recovered = recovered.unwrap_or_else(|_| Recovered::default());
        sums.opened += usize::from(recovered.messages > 0);
        assert_eq!(recovered.messages, found.len() as u64, "{shown}");
        let is_unchecked = |message: &Message| {
            let topic = recovered.unchecked.iter().find(|of| of.topic == message.0);
            topic.is_some_and(|topic| topic.log_times_ns.contains(&message.1))
        };
        let altered: Vec<_> = found.iter().filter(|m| !written.contains(m)).collect();
        if storage == Storage::Mcap {
            assert!(
                altered.iter().all(|m| is_unchecked(m)),
                "{shown} {altered:?}"
            );
        }
        let times: BTreeSet<_> = found.iter().map(|m| m.1).collect();
        let missing = written.iter().filter(|m| !times.contains(&m.1)).count() as u64;
        // One whose time is altered is not lost.
        let of_time = |time| written.iter().any(|m| m.1 == time);
        let misdated = found.iter().filter(|m| !of_time(m.1)).count() as u64;
        assert_eq!(times.len(), found.len(), "twice: {shown}");
        if let Some(lost) = recovered.lost {
            assert_eq!(lost + misdated, missing, "{shown}");
            sums.lost += lost;
        } else {
            assert!(recovered.damages > 0 || found.is_empty(), "{shown}");
            sums.uncounted.push(how.clone());
        }
        sums.damages += 1;
        sums.recovered += sound;
        sums.by_peer += by_peer;
        sums.unchecked += found.iter().filter(|m| is_unchecked(m)).count();
        sums.altered += altered.len();
        sums.missing += missing;
        fs::remove_dir_all(bag).unwrap();
        let _ = fs::remove_dir_all(out);
    }
    println!("{storage:?} of {} each: {sums:?}", written.len());
}

#[test]
fn of_damaged_mcap_at_least_as_much_is_recovered_as_by_a_peer() {
    compare(Storage::Mcap, 24);
}

#[test]
fn of_damaged_sqlite_at_least_as_much_is_recovered_as_row_by_row() {
    compare(Storage::Sqlite3, 24);
}

#[test]
#[ignore = "takes a minute"]
fn two_hundred_damages_of_each_storage() {
    compare(Storage::Mcap, 200);
    compare(Storage::Sqlite3, 200);
}
