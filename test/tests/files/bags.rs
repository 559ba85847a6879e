//! rosbag2 directories against the independent `rosbags` package and on real data.

use std::{
    path::{Path, PathBuf},
    process::Command,
};

use lattice_bag::{
    BagMessage, BagQos, BagReader, BagWriter, ReadOptions, Storage, TopicSpec, WriterOptions,
};
use lattice_test::python::{python, script};
use serde_json::{Value, json};

/// Description of a bag by `bag_peer.py`, or nothing without a Python to run it.
fn run_peer(arguments: &[&str]) -> Option<Value> {
    let python = python()?;
    let script = script("bag_peer.py");
    let output = Command::new(python)
        .arg(script)
        .args(arguments)
        .output()
        .unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "bag_peer {arguments:?}: {stderr}");
    Some(serde_json::from_slice(&output.stdout).unwrap())
}

/// The number that the bytes spell, modulo 2^61 - 1; the peer computes it too.
fn hash(data: &[u8]) -> u64 {
    let prime = (1_u128 << 61) - 1;
    let hash = data.iter().fold(1_u128, |hash, byte| {
        (hash * 256 + u128::from(*byte)) % prime
    });
    u64::try_from(hash).unwrap()
}

fn read_all(reader: &BagReader) -> Vec<BagMessage> {
    reader
        .messages(&ReadOptions::default())
        .unwrap()
        .map(Result::unwrap)
        .collect()
}

/// The same description by our reader.
fn described(reader: &BagReader) -> Value {
    let topics: Vec<Value> = reader
        .topics()
        .iter()
        .map(|t| {
            let latched: Vec<bool> = t.offered_qos.iter().map(|q| q.latched).collect();
            json!({"name": t.name, "type": t.type_name, "count": t.message_count, "latched": latched,
                   "depths": t.offered_qos.iter().map(|q| q.depth).collect::<Vec<_>>(),
                   "definition": hash(t.definition.as_deref().unwrap_or("").as_bytes())})
        })
        .collect();
    let messages: Vec<Value> = read_all(reader)
        .iter()
        .map(|m| {
            json!([
                reader.topics()[m.topic].name,
                m.log_time_ns,
                m.data.len(),
                hash(&m.data)
            ])
        })
        .collect();
    json!({"topics": topics, "messages": messages, "start_ns": reader.start_ns(), "end_ns": reader.end_ns(),
           "message_count": reader.message_count()})
}

#[test]
fn bags_of_rosbags_read_equal() {
    let folder = tempfile::tempdir().unwrap();
    for storage in ["mcap", "sqlite3"] {
        for version in ["8", "9"] {
            for compression in ["none", "file", "message", "storage"] {
                if (storage, compression) == ("sqlite3", "storage") {
                    continue;
                }
                let bag = folder
                    .path()
                    .join(format!("{storage}_{version}_{compression}"));
                let arguments = [
                    "write",
                    bag.to_str().unwrap(),
                    storage,
                    version,
                    compression,
                ];
                let Some(peer) = run_peer(&arguments) else {
                    return;
                };
                let reader = BagReader::open(&bag).unwrap();
                assert_eq!(described(&reader), peer, "{}", bag.display());

                // The same from the storage file alone, by its own marks of compression.
                std::fs::remove_file(bag.join("metadata.yaml")).unwrap();
                let reader = BagReader::open(&bag).unwrap();
                assert_eq!(
                    described(&reader)["messages"],
                    peer["messages"],
                    "{}",
                    bag.display()
                );
            }
        }
    }
}

#[test]
fn our_bags_open_in_rosbags() {
    let folder = tempfile::tempdir().unwrap();
    for storage in [Storage::Mcap, Storage::Sqlite3] {
        let bag = folder.path().join(storage.identifier());
        write_bag(&bag, storage);
        let reader = BagReader::open(&bag).unwrap();
        let ours = described(&reader);
        assert_eq!(ours["messages"].as_array().unwrap().len(), 500);
        let Some(peer) = run_peer(&["read", bag.to_str().unwrap()]) else {
            return;
        };
        assert_eq!(peer, ours, "{}", bag.display());
    }
}

fn write_bag(bag: &Path, storage: Storage) {
    let latched = BagQos {
        depth: 1,
        latched: true,
        ..BagQos::default()
    };
    let sensor = BagQos {
        reliable: false,
        ..BagQos::default()
    };
    let topics = [
        ("/latched", vec![latched.clone(), latched]),
        ("/sensor", vec![sensor]),
        ("/silent", vec![]),
    ];
    let mut writer = BagWriter::create(bag, storage, WriterOptions::default()).unwrap();
    for (name, offered_qos) in topics {
        let (type_name, definition) = ("std_msgs/msg/String".into(), Some("string data\n".into()));
        writer
            .add_topic(TopicSpec {
                name: name.into(),
                type_name,
                definition,
                offered_qos,
            })
            .unwrap();
    }
    for i in 0..500_i64 {
        let content = (0..i * 7).map(|k| u8::try_from((k * k + i) % 256).unwrap());
        let data: Vec<u8> = [0, 1, 0, 0].into_iter().chain(content).collect();
        let log_time_ns = 1_700_000_000_000_000_000 + i * 1_000_000;
        writer
            .write(usize::from(i % 100 != 0), log_time_ns, &data)
            .unwrap();
    }
    writer.finish().unwrap();
}

fn kitti() -> Option<PathBuf> {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/kitti00");
    if !data.is_dir() {
        println!("skipped: {} is not there", data.display());
        return None;
    }
    Some(data)
}

#[test]
fn kitti_mcap_has_all_messages_and_sqlite3_the_first_three_scans() {
    let Some(data) = kitti() else { return };
    let mcap = BagReader::open(&data.join("bag_mcap")).unwrap();
    let sqlite = BagReader::open(&data.join("bag_sqlite3")).unwrap();
    assert_eq!(mcap.message_count(), 1182);
    let (a, b) = (read_all(&mcap), read_all(&sqlite));
    assert_eq!((a.len(), b.len()), (1182, 1174));
    assert!(a.is_sorted_by_key(|m| m.log_time_ns) && b.is_sorted_by_key(|m| m.log_time_ns));
    assert_eq!(mcap.start_ns(), Some(1_299_999_999_950_000_128));
    assert_eq!(mcap.end_ns(), a.last().map(|m| m.log_time_ns));
    let points = |messages: &[BagMessage], reader: &BagReader| -> Vec<(i64, Vec<u8>)> {
        let of_topic = |m: &&BagMessage| reader.topics()[m.topic].name == "/velodyne/points";
        messages
            .iter()
            .filter(of_topic)
            .map(|m| (m.log_time_ns, m.data.clone()))
            .collect()
    };
    assert_eq!(points(&b, &sqlite), points(&a, &mcap)[..3]);

    // A time window of one topic, against the whole.
    let (start_ns, end_ns) = (a[300].log_time_ns, a[900].log_time_ns);
    let options = ReadOptions {
        topics: Some(vec!["/ins/imu".into()]),
        start_ns: Some(start_ns),
        end_ns: Some(end_ns),
    };
    for (reader, all) in [(&mcap, &a), (&sqlite, &b)] {
        let some: Vec<BagMessage> = reader
            .messages(&options)
            .unwrap()
            .map(Result::unwrap)
            .collect();
        let wanted = |m: &&BagMessage| {
            reader.topics()[m.topic].name == "/ins/imu"
                && (start_ns..end_ns).contains(&m.log_time_ns)
        };
        let expected: Vec<BagMessage> = all.iter().filter(wanted).cloned().collect();
        assert!(expected.len() > 100);
        assert_eq!(some, expected);
    }
}

#[test]
fn kitti_opens_without_metadata_and_as_bare_files() {
    let Some(data) = kitti() else { return };
    for (bag, file) in [
        ("bag_mcap", "bag_mcap.mcap"),
        ("bag_sqlite3", "bag_sqlite3.db3"),
    ] {
        let whole = BagReader::open(&data.join(bag)).unwrap();
        let bare = BagReader::open(&data.join(bag).join(file)).unwrap();
        assert_eq!(read_all(&whole).len(), read_all(&bare).len());
        let counts = |r: &BagReader| -> Vec<(String, u64)> {
            r.topics()
                .iter()
                .map(|t| (t.name.clone(), t.message_count))
                .collect()
        };
        assert_eq!(counts(&whole), counts(&bare));
        assert!(
            bare.topics()
                .iter()
                .all(|t| t.definition.is_some() && !t.offered_qos.is_empty())
        );
    }
}
