//! rosbag2 directories against the independent `rosbags` package and on real data.

use std::{path::Path, process::Command};

use lattice_bag::{
    BagMessage, BagQos, BagReader, BagWriter, ReadOptions, Storage, TopicSpec, WriterOptions,
};
use lattice_msgs::hash_of;
use lattice_test::data::shared;
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

/// The number that the bytes spell, modulo 2^61 - 1, as the peer computes it.
pub(super) fn hash(data: &[u8]) -> u64 {
    let prime = (1_u128 << 61) - 1;
    let hash = data.iter().fold(1_u128, |hash, byte| {
        (hash * 256 + u128::from(*byte)) % prime
    });
    u64::try_from(hash).unwrap()
}

fn read(reader: &BagReader, options: &ReadOptions) -> Vec<BagMessage> {
    let messages = reader.messages(options).unwrap();
    messages.map(Result::unwrap).collect()
}

fn read_all(reader: &BagReader) -> Vec<BagMessage> {
    read(reader, &ReadOptions::default())
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
                   "definition": hash(t.definition.as_deref().unwrap_or("").as_bytes()),
                   "type_hash": t.type_hash})
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
    let storages = [
        ("mcap", &["none", "file", "message", "storage"][..]),
        ("sqlite3", &["none", "file", "message"]),
    ];
    for (storage, compressions) in storages {
        for (version, compression) in ["8", "9"]
            .into_iter()
            .flat_map(|version| compressions.iter().map(move |c| (version, *c)))
        {
            let name = format!("{storage}_{version}_{compression}");
            let bag = folder.path().join(&name);
            let path = bag.to_str().unwrap();
            let Some(peer) = run_peer(&["write", path, storage, version, compression]) else {
                return;
            };
            let reader = BagReader::open(&bag).unwrap();
            assert_eq!(described(&reader), peer, "{name}");

            // The same from the storage file alone, by its own marks of compression.
            std::fs::remove_file(bag.join("metadata.yaml")).unwrap();
            let bare = described(&BagReader::open(&bag).unwrap());
            assert_eq!(bare["messages"], peer["messages"], "{name}");
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
    let mut writer = BagWriter::create(bag, storage, WriterOptions::default()).unwrap();
    let mut add = |name: &str, offered_qos: Vec<BagQos>| {
        let topic = TopicSpec {
            name: name.into(),
            type_name: "std_msgs/msg/String".into(),
            type_hash: hash_of("std_msgs/msg/String").unwrap().into(),
            definition: Some("string data\n".into()),
            offered_qos,
        };
        writer.add_topic(topic).unwrap();
    };
    let latched = BagQos {
        depth: 1,
        latched: true,
        ..BagQos::default()
    };
    let sensor = BagQos {
        reliable: false,
        ..BagQos::default()
    };
    add("/latched", vec![latched.clone(), latched]);
    add("/sensor", vec![sensor]);
    add("/silent", vec![]);
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

#[test]
fn kitti_mcap_has_all_messages_and_sqlite3_the_first_three_scans() {
    let Some(data) = shared("kitti00") else {
        return;
    };
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

    // Bare files, without the metadata.
    let counts = |reader: &BagReader| -> Vec<(String, u64)> {
        let topics = reader.topics().iter();
        topics.map(|t| (t.name.clone(), t.message_count)).collect()
    };
    for (file, whole, all) in [
        ("bag_mcap/bag_mcap.mcap", &mcap, &a),
        ("bag_sqlite3/bag_sqlite3.db3", &sqlite, &b),
    ] {
        let bare = BagReader::open(&data.join(file)).unwrap();
        assert_eq!(&read_all(&bare), all);
        assert_eq!(counts(&bare), counts(whole));
        let mut topics = bare.topics().iter();
        assert!(topics.all(|t| t.definition.is_some() && !t.offered_qos.is_empty()));
    }

    // A time window of one topic, against the whole.
    let (start_ns, end_ns) = (a[300].log_time_ns, a[900].log_time_ns);
    let options = ReadOptions {
        topics: Some(vec!["/ins/imu".into()]),
        start_ns: Some(start_ns),
        end_ns: Some(end_ns),
        ..ReadOptions::default()
    };
    for (reader, all) in [(&mcap, &a), (&sqlite, &b)] {
        let some = read(reader, &options);
        let wanted = |m: &&BagMessage| {
            reader.topics()[m.topic].name == "/ins/imu"
                && (start_ns..end_ns).contains(&m.log_time_ns)
        };
        let expected: Vec<BagMessage> = all.iter().filter(wanted).cloned().collect();
        assert!(expected.len() > 100);
        assert_eq!(some, expected);
    }
}
