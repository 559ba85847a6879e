//! Bags of ROS 1 made here, read and converted.

mod damage;

use std::collections::BTreeMap;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use crate::{BagError, BagMessage, BagReader, ReadOptions, Storage, convert};

const T0_S: u32 = 1_700_000_000;
const COUNT: u32 = 120;
const DEFINITION: &str =
    "Header header\nfloat64[] x\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n";

fn prefixed(bytes: &[u8]) -> Vec<u8> {
    [&(bytes.len() as u32).to_le_bytes(), bytes].concat()
}

fn record(fields: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let field = |(name, value): &(&str, &[u8])| prefixed(&[name.as_bytes(), b"=", value].concat());
    let header: Vec<u8> = fields.iter().flat_map(field).collect();
    [prefixed(&header), prefixed(data)].concat()
}

/// Time of message `i`, s and ns.
fn time(i: u32) -> [u8; 8] {
    let bytes = [T0_S + i / 10, i % 10 * 100_000_000].map(u32::to_le_bytes);
    bytes.concat().try_into().unwrap()
}

fn connection(number: u32, topic: &str) -> Vec<u8> {
    let fields: [(&str, &[u8]); 5] = [
        ("topic", topic.as_bytes()),
        ("type", b"my_msgs/Values"),
        ("md5sum", b"*"),
        ("message_definition", DEFINITION.as_bytes()),
        ("latching", if number == 1 { b"1" } else { b"0" }),
    ];
    let header = record(&fields, &[]);
    // Without its lengths it is the data.
    let data = &header[4..header.len() - 4];
    let number = number.to_le_bytes();
    let fields: [(&str, &[u8]); 3] = [("conn", &number), ("op", &[7]), ("topic", topic.as_bytes())];
    record(&fields, data)
}

/// Message `i` in ROS 1 serialization, and as CDR.
fn message(i: u32) -> [Vec<u8>; 2] {
    let values = (0..i % 7).flat_map(|n| f64::from(n * i).to_le_bytes());
    let values: Vec<u8> = values.collect();
    let ros1 = [
        &i.to_le_bytes()[..],
        &time(i),
        &prefixed(b"map"),
        &(i % 7).to_le_bytes(),
        &values,
    ];
    let padding: &[u8] = if values.is_empty() { &[] } else { &[0; 4] };
    let cdr = [
        &[0, 1, 0, 0][..],
        &time(i),
        &prefixed(b"map\0"),
        &(i % 7).to_le_bytes(),
        padding,
        &values,
    ];
    [ros1.concat(), cdr.concat()]
}

fn compressed(compression: &str, content: &[u8]) -> Vec<u8> {
    match compression {
        "none" => content.to_vec(),
        "bz2" => {
            let level = bzip2::Compression::best();
            let mut encoder = bzip2::write::BzEncoder::new(Vec::new(), level);
            encoder.write_all(content).unwrap();
            encoder.finish().unwrap()
        }
        _ => {
            let mut encoder = lz4::EncoderBuilder::new().build(Vec::new()).unwrap();
            encoder.write_all(content).unwrap();
            let (bytes, ended) = encoder.finish();
            ended.unwrap();
            bytes
        }
    }
}

fn chunk(compression: &str, content: &[u8], size: u32) -> Vec<u8> {
    let size = size.to_le_bytes();
    let fields: [(&str, &[u8]); 3] = [
        ("compression", compression.as_bytes()),
        ("op", &[5]),
        ("size", &size),
    ];
    record(&fields, &compressed(compression, content))
}

fn message_record(i: u32) -> Vec<u8> {
    let (number, time) = ((i % 2).to_le_bytes(), time(i));
    let fields: [(&str, &[u8]); 3] = [("conn", &number), ("op", &[2]), ("time", &time)];
    record(&fields, &message(i)[0])
}

fn first_record(index_pos: u64, connections: u32, chunks: u32) -> Vec<u8> {
    let numbers = [connections.to_le_bytes(), chunks.to_le_bytes()];
    let index_pos = index_pos.to_le_bytes();
    let fields: [(&str, &[u8]); 4] = [
        ("chunk_count", &numbers[1]),
        ("conn_count", &numbers[0]),
        ("index_pos", &index_pos),
        ("op", &[3]),
    ];
    [super::MAGIC, &record(&fields, &[b' '; 100])].concat()
}

/// A bag of messages from `first` on in chunks of ten, with an index or without.
fn bag(compression: &str, first: u32, has_index: bool) -> Vec<u8> {
    let topics = ["/a", "/b"].into_iter().zip(0..);
    let connections = topics.map(|(topic, number)| connection(number, topic));
    let connections: Vec<u8> = connections.flatten().collect();
    let mut bytes = first_record(0, 0, 0);
    let mut infos = Vec::new();
    for begin in (first..first + COUNT).step_by(10) {
        let mut content = match begin == first {
            true => connections.clone(),
            false => Vec::new(),
        };
        (begin..begin + 10).for_each(|i| content.extend(message_record(i)));
        let place = (bytes.len() as u64).to_le_bytes();
        bytes.extend(chunk(compression, &content, content.len() as u32));
        for number in 0..2_u32 {
            let fields: [(&str, &[u8]); 4] = [
                ("conn", &number.to_le_bytes()),
                ("count", &5_u32.to_le_bytes()),
                ("op", &[4]),
                ("ver", &1_u32.to_le_bytes()),
            ];
            bytes.extend(record(&fields, &[0; 60]));
        }
        let counts = [0_u32, 5, 1, 5].map(u32::to_le_bytes).concat();
        let fields: [(&str, &[u8]); 6] = [
            ("chunk_pos", &place),
            ("count", &2_u32.to_le_bytes()),
            ("end_time", &time(begin + 9)),
            ("op", &[6]),
            ("start_time", &time(begin)),
            ("ver", &1_u32.to_le_bytes()),
        ];
        infos.push(record(&fields, &counts));
    }
    if has_index {
        let index_pos = bytes.len() as u64;
        let header = first_record(index_pos, 2, infos.len() as u32);
        bytes.splice(..header.len(), header);
        bytes.extend(connections);
        bytes.extend(infos.concat());
    }
    bytes
}

fn expected(first: u32, count: u32) -> Vec<BagMessage> {
    let of = |i: u32| BagMessage {
        topic: (i % 2) as usize,
        log_time_ns: i64::from(T0_S) * 1_000_000_000 + i64::from(i) * 100_000_000,
        data: message(i)[1].clone(),
    };
    (first..first + count).map(of).collect()
}

/// The readable messages, and the error behind them.
fn read(path: &Path) -> (Vec<BagMessage>, Option<BagError>) {
    let reader = match BagReader::open(path) {
        Ok(reader) => reader,
        Err(error) => return (Vec::new(), Some(error)),
    };
    let mut messages = Vec::new();
    for message in reader.messages(&ReadOptions::default()).unwrap() {
        match message {
            Ok(message) => messages.push(message),
            Err(error) => return (messages, Some(error)),
        }
    }
    (messages, None)
}

fn written(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    fs::write(&path, bytes).unwrap();
    path
}

const COMPRESSIONS: [&str; 3] = ["none", "bz2", "lz4"];

#[test]
fn messages_are_those_of_ros2() {
    let folder = tempfile::tempdir().unwrap();
    for compression in COMPRESSIONS {
        for has_index in [true, false] {
            let path = written(folder.path(), "x.bag", &bag(compression, 0, has_index));
            let reader = BagReader::open(&path).unwrap();
            assert!(reader.is_ros1());
            assert_eq!(reader.storage_name(), "rosbag1");
            let topics = reader.topics().iter().map(|topic| {
                assert_eq!(topic.serialization_format, "cdr");
                assert!(topic.definition.is_some());
                let type_name = topic.type_name.as_str();
                (
                    topic.name.as_str(),
                    type_name,
                    topic.message_count,
                    topic.is_latched(),
                )
            });
            let topics: Vec<_> = topics.collect();
            let half = u64::from(COUNT / 2);
            let kind = "my_msgs/msg/Values";
            assert_eq!(
                topics,
                [("/a", kind, half, false), ("/b", kind, half, true)]
            );
            let (messages, error) = read(&path);
            assert!(error.is_none(), "{compression} {has_index}: {error:?}");
            assert_eq!(messages, expected(0, COUNT), "{compression} {has_index}");
            let window = ReadOptions {
                topics: Some(vec!["/b".to_owned()]),
                start_ns: Some(messages[30].log_time_ns),
                end_ns: Some(messages[40].log_time_ns),
                ..ReadOptions::default()
            };
            assert_eq!(reader.messages(&window).unwrap().count(), 5);
        }
    }
}

#[test]
fn split_bags_of_a_folder_are_one_log() {
    let folder = tempfile::tempdir().unwrap();
    written(folder.path(), "x_0.bag", &bag("lz4", 0, true));
    written(folder.path(), "x_1.bag.active", &bag("lz4", COUNT, false));
    let (messages, error) = read(folder.path());
    assert!(error.is_none(), "{error:?}");
    assert_eq!(messages, expected(0, 2 * COUNT));
}

#[test]
fn a_killed_recorder_leaves_an_open_chunk() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = bag("none", 0, false);
    bytes.extend(chunk("none", &[], 0));
    (COUNT..COUNT + 5).for_each(|i| bytes.extend(message_record(i)));
    let whole = bytes.len();
    bytes.extend(message_record(COUNT + 5));
    bytes.truncate(bytes.len() - 3);
    let path = written(folder.path(), "x.bag.active", &bytes[..whole]);
    let (messages, error) = read(&path);
    assert!(error.is_none(), "{error:?}");
    assert_eq!(messages, expected(0, COUNT + 5));
    let path = written(folder.path(), "x.bag.active", &bytes);
    let (messages, error) = read(&path);
    assert_eq!(messages, expected(0, COUNT + 5));
    assert!(matches!(
        error,
        Some(BagError::Truncated {
            readable_messages: 125,
            ..
        })
    ));
    let passed = BagReader::open(&path).unwrap().past_cut();
    assert_eq!(passed.cuts().len(), 1);
    let messages = passed.messages(&ReadOptions::default()).unwrap();
    assert!(messages.map(Result::unwrap).eq(expected(0, COUNT + 5)));
    // Of a compressed chunk nothing is complete.
    let mut bytes = bag("bz2", 0, false);
    bytes.extend(chunk("none", &[], 0));
    let place = bytes.windows(4).rposition(|part| part == b"none").unwrap();
    bytes.splice(place..place + 4, *b"bz2");
    let length = place - "compression=".len() - 8;
    bytes[length] -= 1;
    bytes[length + 4] -= 1;
    bytes.extend(b"BZh91AY&SY");
    let (messages, error) = read(&written(folder.path(), "y.bag.active", &bytes));
    assert_eq!(messages, expected(0, COUNT));
    assert!(
        matches!(error, Some(BagError::Truncated { .. })),
        "{error:?}"
    );
}

#[test]
fn other_formats_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let old = written(folder.path(), "old.bag", b"#ROSBAG V1.2\nxxxx");
    let error = read(&old).1.unwrap().to_string();
    assert!(
        error.contains("format 1") && error.contains("rosbag compress"),
        "{error}"
    );
    let mut bytes = bag("none", 0, true);
    let place = bytes
        .windows(4)
        .position(|part| part == b"op=\x03")
        .unwrap();
    let field = prefixed(b"encryptor=rosbag/AesCbcEncryptor");
    bytes.splice(place - 4..place - 4, field.clone());
    bytes[13] += field.len() as u8;
    let path = written(folder.path(), "x.bag", &bytes);
    let error = read(&path).1.unwrap().to_string();
    assert!(
        error.contains("encrypted by rosbag/AesCbcEncryptor"),
        "{error}"
    );
}

#[test]
fn bags_convert_to_rosbag2() {
    let folder = tempfile::tempdir().unwrap();
    let path = written(folder.path(), "x.bag", &bag("bz2", 0, true));
    let out = folder.path().join("out");
    let converted = convert(&path, &out).unwrap();
    assert_eq!(
        (converted.messages, converted.topics),
        (u64::from(COUNT), 2)
    );
    let reader = BagReader::open(&out).unwrap();
    assert!(!reader.is_ros1() && reader.storage() == Storage::Mcap);
    assert!(reader.topics()[1].is_latched());
    assert_eq!(read(&out).0, expected(0, COUNT));
    assert!(matches!(convert(&path, &out), Err(BagError::Exists { .. })));
    // Nothing stays of a bag with damage.
    let mut bytes = bag("none", 0, true);
    let place = bytes
        .windows(4)
        .rposition(|part| part == b"op=\x02")
        .unwrap();
    bytes[place + 3] = 99;
    let path = written(folder.path(), "y.bag", &bytes);
    let other = folder.path().join("other");
    assert!(convert(&path, &other).is_err());
    assert!(!other.exists());
}

#[test]
fn mcap_of_ros1_reads_as_ros2() {
    let folder = tempfile::tempdir().unwrap();
    for options in [
        mcap::WriteOptions::new(),
        mcap::WriteOptions::new().use_chunks(false),
    ] {
        let path = folder.path().join("x.mcap");
        let file = std::io::BufWriter::new(fs::File::create(&path).unwrap());
        let mut writer = options.profile("ros1").create(file).unwrap();
        let definition = DEFINITION.as_bytes();
        let schema = writer.add_schema("my_msgs/Values", "ros1msg", definition);
        let schema = schema.unwrap();
        let latched = BTreeMap::from([("latching".to_owned(), "1".to_owned())]);
        let channels = [
            writer
                .add_channel(schema, "/a", "ros1", &BTreeMap::new())
                .unwrap(),
            writer.add_channel(schema, "/b", "ros1", &latched).unwrap(),
        ];
        for (i, message_of) in expected(0, COUNT).iter().enumerate() {
            let header = mcap::records::MessageHeader {
                channel_id: channels[message_of.topic],
                sequence: 0,
                log_time: message_of.log_time_ns as u64,
                publish_time: message_of.log_time_ns as u64,
            };
            let data = &message(i as u32)[0];
            writer.write_to_known_channel(&header, data).unwrap();
        }
        writer.finish().unwrap();
        drop(writer);
        let reader = BagReader::open(&path).unwrap();
        assert!(reader.is_ros1() && reader.topics()[1].is_latched());
        assert_eq!(reader.topics()[0].type_name, "my_msgs/msg/Values");
        let (messages, error) = read(&path);
        assert!(error.is_none(), "{error:?}");
        assert_eq!(messages, expected(0, COUNT));
    }
}
