//! Bags written, cut, bent and read again.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use mcap::records::MessageHeader;
use proptest::prelude::*;
use rusqlite::Connection;
use tempfile::TempDir;

use super::*;

const SECOND_NS: i64 = 1_000_000_000;
const T0_NS: i64 = 1_700_000_000 * SECOND_NS;

pub(super) fn spec(name: &str, latched: bool) -> TopicSpec {
    let durability = if latched {
        BagDurability::TransientLocal
    } else {
        BagDurability::Volatile
    };
    TopicSpec {
        name: name.into(),
        type_name: "std_msgs/msg/String".into(),
        definition: Some("string data\n".into()),
        offered_qos: vec![BagQos {
            depth: 1,
            durability,
            ..BagQos::default()
        }],
    }
}

pub(super) fn cdr(seed: i64, len: usize) -> Vec<u8> {
    let mut data = vec![0, 1, 0, 0];
    data.extend((0..len).map(|i| (i as i64 * 31 + seed * 7).rem_euclid(251) as u8));
    data
}

/// `count` messages at 10 Hz on "/a" and "/b" in turn.
fn write(
    folder: &Path,
    storage: Storage,
    compression: Compression,
    count: i64,
    first: i64,
) -> Vec<BagMessage> {
    let options = WriterOptions {
        compression,
        overwrite: true,
    };
    let mut writer = BagWriter::create(folder, storage, options).unwrap();
    writer.add_topic(spec("/a", false)).unwrap();
    writer.add_topic(spec("/b", false)).unwrap();
    let mut messages = Vec::new();
    for i in first..first + count {
        let data = cdr(i, 40 + (i % 13) as usize * 20);
        let (topic, log_time_ns) = ((i % 2) as usize, T0_NS + i * SECOND_NS / 10);
        writer.write(topic, log_time_ns, &data).unwrap();
        messages.push(BagMessage {
            topic,
            log_time_ns,
            data,
        });
    }
    writer.finish().unwrap();
    messages
}

fn storage_file(folder: &Path) -> PathBuf {
    let files = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    files
        .into_iter()
        .find(|path| !path.ends_with("metadata.yaml"))
        .unwrap()
}

fn read(path: &Path) -> Result<Vec<BagMessage>, BagError> {
    BagReader::open(path)?
        .messages(&ReadOptions::default())?
        .collect()
}

/// What can be read, and the error behind it.
fn read_some(path: &Path) -> (Vec<BagMessage>, Option<BagError>) {
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

const ALL: [(Storage, Compression); 7] = [
    (Storage::Mcap, Compression::None),
    (Storage::Mcap, Compression::ZstdChunk),
    (Storage::Mcap, Compression::ZstdMessage),
    (Storage::Mcap, Compression::ZstdFile),
    (Storage::Sqlite3, Compression::None),
    (Storage::Sqlite3, Compression::ZstdMessage),
    (Storage::Sqlite3, Compression::ZstdFile),
];

#[test]
fn every_storage_and_compression_round_trips() {
    let folder = tempfile::tempdir().unwrap();
    for (storage, compression) in ALL {
        let bag = folder.path().join("a bag with ? and % and # in its name");
        let written = write(&bag, storage, compression, 200, 0);
        assert_eq!(read(&bag).unwrap(), written, "{storage:?} {compression:?}");
        assert_eq!(
            read(&storage_file(&bag)).unwrap(),
            written,
            "{storage:?} {compression:?} bare"
        );
        let reader = BagReader::open(&bag).unwrap();
        assert_eq!(
            (reader.start_ns(), reader.end_ns()),
            (Some(T0_NS), Some(T0_NS + 199 * SECOND_NS / 10))
        );
        assert_eq!(
            reader.topics()[0].definition.as_deref(),
            Some("string data\n")
        );
        assert_eq!(reader.topics()[0].message_count, 100);
        assert_eq!(reader.summary().storage, storage);
    }
}

#[test]
fn messages_written_out_of_order_come_in_order() {
    let folder = tempfile::tempdir().unwrap();
    for storage in [Storage::Mcap, Storage::Sqlite3] {
        let bag = folder.path().join(storage.identifier());
        let mut writer = BagWriter::create(&bag, storage, WriterOptions::default()).unwrap();
        writer.add_topic(spec("/a", false)).unwrap();
        // Half a megabyte each, so that MCAP needs several chunks and they overlap.
        for i in 0..20_i64 {
            writer
                .write(0, T0_NS + (i * 7) % 20, &cdr(i, 500_000))
                .unwrap();
        }
        writer.finish().unwrap();
        let times: Vec<i64> = read(&bag)
            .unwrap()
            .iter()
            .map(|m| m.log_time_ns - T0_NS)
            .collect();
        assert_eq!(times, (0..20).collect::<Vec<_>>());
    }
}

#[test]
fn an_empty_bag_is_no_error() {
    let folder = tempfile::tempdir().unwrap();
    for (storage, compression) in ALL {
        let bag = folder.path().join("bag");
        assert_eq!(write(&bag, storage, compression, 0, 0), vec![]);
        let reader = BagReader::open(&bag).unwrap();
        assert_eq!(
            (
                reader.start_ns(),
                reader.message_count(),
                reader.topics().len()
            ),
            (None, 0, 2)
        );
        assert_eq!(read(&bag).unwrap(), vec![]);
    }
}

#[test]
fn splits_merge_by_time_whether_compressed_or_not() {
    let folder = tempfile::tempdir().unwrap();
    for (storage, compression) in ALL {
        let (one, two, both) = (
            folder.path().join("one"),
            folder.path().join("two"),
            folder.path().join("both"),
        );
        let mut expected = write(&one, storage, compression, 30, 0);
        // The second starts before the first ends.
        expected.extend(write(&two, storage, compression, 30, 25));
        expected.sort_by_key(|m| m.log_time_ns);
        fs::create_dir(&both).unwrap();
        let mut lists = String::new();
        let mut files = String::new();
        for (bag, first) in [(&two, 25), (&one, 0)] {
            let file = storage_file(bag);
            let name = file.file_name().unwrap().to_str().unwrap().to_owned();
            fs::copy(&file, both.join(&name)).unwrap();
            lists.push_str(&format!("  - {name}\n"));
            files.push_str(&format!(
                "  - path: {name}\n    starting_time: {{nanoseconds_since_epoch: {}}}\n    \
                 duration: {{nanoseconds: 2900000000}}\n    message_count: 30\n",
                T0_NS + first * SECOND_NS / 10
            ));
        }
        let text = fs::read_to_string(one.join("metadata.yaml")).unwrap();
        let single = storage_file(&one)
            .file_name()
            .unwrap()
            .to_str()
            .unwrap()
            .to_owned();
        let (head, tail) = text.split_once("  relative_file_paths:\n").unwrap();
        let custom = tail.find("  custom_data").unwrap();
        assert!(tail[..custom].contains(&single));
        let text = format!(
            "{head}  relative_file_paths:\n{lists}  files:\n{files}{}",
            &tail[custom..]
        );
        fs::write(both.join("metadata.yaml"), text).unwrap();
        let by_time = |path: &Path| -> Vec<(i64, Vec<u8>)> {
            read(path)
                .unwrap()
                .into_iter()
                .map(|m| (m.log_time_ns, m.data))
                .collect()
        };
        let mut found = by_time(&both);
        assert!(
            found.is_sorted_by_key(|m| m.0),
            "{storage:?} {compression:?}"
        );
        let mut wanted: Vec<_> = expected
            .iter()
            .map(|m| (m.log_time_ns, m.data.clone()))
            .collect();
        found.sort();
        wanted.sort();
        assert_eq!(found, wanted, "{storage:?} {compression:?}");
        fs::remove_file(both.join("metadata.yaml")).unwrap();
        assert_eq!(by_time(&both).len(), 60);
        fs::remove_dir_all(&both).unwrap();
    }
}

/// A cut file yields a beginning of the whole, and an error unless all of it.
fn check_cut(file: &Path, whole: &[u8], cut: usize, written: &[BagMessage]) {
    fs::write(file, &whole[..cut]).unwrap();
    let (some, error) = read_some(file);
    assert!(
        some.len() <= written.len() && some == written[..some.len()],
        "cut at {cut}"
    );
    assert!(
        error.is_some() || some.len() == written.len(),
        "cut at {cut}: {} silently",
        some.len()
    );
    if let Some(BagError::Truncated {
        readable_messages,
        size_bytes,
        ..
    }) = error
    {
        assert_eq!(
            (readable_messages, size_bytes),
            (some.len() as u64, cut as u64),
            "cut at {cut}"
        );
    }
}

#[test]
fn an_mcap_file_cut_at_any_byte_yields_what_precedes_the_cut() {
    let folder = tempfile::tempdir().unwrap();
    for (compression, chunked) in [
        (Compression::None, true),
        (Compression::ZstdChunk, true),
        (Compression::None, false),
    ] {
        let bag = folder.path().join("bag");
        let (file, written) = match chunked {
            true => (None, write(&bag, Storage::Mcap, compression, 12, 0)),
            false => {
                let (file, written) = write_foreign(
                    folder.path(),
                    mcap::WriteOptions::new().use_chunks(false),
                    "cdr",
                );
                (Some(file), written)
            }
        };
        let whole = fs::read(file.unwrap_or_else(|| storage_file(&bag))).unwrap();
        let file = folder.path().join("cut.mcap");
        for cut in 0..=whole.len() {
            check_cut(&file, &whole, cut, &written);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn cut_or_bent_files_never_panic(
        kind in 0..ALL.len(),
        at in 0.0..1.0_f64,
        value in any::<u8>(),
        bend in any::<bool>(),
    ) {
        let (storage, compression) = ALL[kind];
        let folder = tempfile::tempdir().unwrap();
        let bag = folder.path().join("bag");
        let written = write(&bag, storage, compression, 60, 0);
        let file = storage_file(&bag);
        let mut whole = fs::read(&file).unwrap();
        let place = (whole.len() as f64 * at) as usize;
        if bend {
            whole[place] = value;
            fs::write(&file, &whole).unwrap();
            let _ = read_some(&bag);
            let (some, error) = read_some(&file);
            prop_assert!(some.len() <= written.len() || error.is_some());
        } else {
            check_cut(&file, &whole, place, &written);
        }
    }
}

/// An MCAP file as programs other than rosbag2 write it; several chunks where there are any.
fn write_foreign(
    folder: &Path,
    options: mcap::WriteOptions,
    encoding: &str,
) -> (PathBuf, Vec<BagMessage>) {
    let path = folder.join("foreign.mcap");
    let file = std::io::BufWriter::new(fs::File::create(&path).unwrap());
    let mut writer = options.chunk_size(Some(300)).create(file).unwrap();
    let schema = writer
        .add_schema("std_msgs/String", "ros2idl", b"struct String {};")
        .unwrap();
    let channel = writer
        .add_channel(schema, "/a", encoding, &BTreeMap::new())
        .unwrap();
    let mut messages = Vec::new();
    for i in 0..12 {
        let data = cdr(i, 90);
        let log_time = (T0_NS + i) as u64;
        let header = MessageHeader {
            channel_id: channel,
            sequence: 0,
            log_time,
            publish_time: log_time,
        };
        writer.write_to_known_channel(&header, &data).unwrap();
        messages.push(BagMessage {
            topic: 0,
            log_time_ns: T0_NS + i,
            data,
        });
    }
    writer.finish().unwrap();
    (path, messages)
}

#[test]
fn mcap_files_of_other_writers_read() {
    let folder = tempfile::tempdir().unwrap();
    let new = mcap::WriteOptions::new;
    for options in [
        new().compression(Some(mcap::Compression::Lz4)),
        new()
            .compression(Some(mcap::Compression::Zstd))
            .emit_message_indexes(false),
        new().use_chunks(false),
        new().emit_summary_records(false),
        new().emit_statistics(false).compression(None),
        new().repeat_channels(false).repeat_schemas(false),
        new().emit_chunk_indexes(false).calculate_chunk_crcs(false),
    ] {
        let shown = format!("{options:?}");
        let (path, written) = write_foreign(folder.path(), options, "cdr");
        let reader = BagReader::open(&path).unwrap();
        assert_eq!(read(&path).unwrap(), written, "{shown}");
        assert_eq!(reader.topics()[0].type_name, "std_msgs/msg/String");
        assert_eq!(
            reader.topics()[0].definition.as_deref(),
            Some("struct String {};")
        );
        assert_eq!(
            (reader.message_count(), reader.topics()[0].message_count),
            (12, 12),
            "{shown}"
        );
        assert_eq!(reader.end_ns(), Some(T0_NS + 11), "{shown}");
    }
}

#[test]
fn a_bent_chunk_is_told_by_its_crc_and_place() {
    let folder = tempfile::tempdir().unwrap();
    let (path, written) = write_foreign(
        folder.path(),
        mcap::WriteOptions::new().compression(None),
        "cdr",
    );
    let mut bytes = fs::read(&path).unwrap();
    let needle = &written[9].data[50..80];
    let place = bytes
        .windows(30)
        .position(|window| window == needle)
        .unwrap();
    bytes[place] ^= 0x10;
    fs::write(&path, &bytes).unwrap();
    let (some, error) = read_some(&path);
    assert!(!some.is_empty() && some == written[..some.len()]);
    let told = error.unwrap().to_string();
    assert!(
        told.contains("CRC") && told.contains("chunk at byte"),
        "{told}"
    );
}

#[test]
fn foreign_files_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        let told = BagReader::open(&path).err().unwrap().to_string();
        assert!(told.contains(name), "{told}");
        told
    };
    assert!(refused("ros1.bag", b"#ROSBAG V2.0\nEgo").contains("a ROS 1 bag"));
    assert!(refused("image.mcap", b"\x89PNG\r\n\x1a\n0000").contains("a PNG image"));
    assert!(refused("empty.db3", b"").contains("empty"));
    let (protobuf, _) = write_foreign(folder.path(), mcap::WriteOptions::new(), "protobuf");
    let told = read(&protobuf).unwrap_err().to_string();
    assert!(told.contains("an MCAP file of protobuf messages"), "{told}");

    let other = folder.path().join("other.db3");
    Connection::open(&other)
        .unwrap()
        .execute_batch("CREATE TABLE people(name TEXT);")
        .unwrap();
    assert!(read(&other).unwrap_err().to_string().contains("people"));
    // A view could hide an endless query.
    let view = folder.path().join("view.db3");
    let sql = "CREATE TABLE topics(id, name, type, serialization_format); CREATE VIEW messages AS SELECT 1;";
    Connection::open(&view).unwrap().execute_batch(sql).unwrap();
    assert!(matches!(read(&view), Err(BagError::Foreign { .. })));

    let nothing = folder.path().join("nothing");
    fs::create_dir(&nothing).unwrap();
    assert!(
        read(&nothing)
            .unwrap_err()
            .to_string()
            .contains("without metadata.yaml")
    );
    assert!(matches!(
        read(&folder.path().join("missing")),
        Err(BagError::Io { .. })
    ));
}

#[test]
fn metadata_cannot_lead_out_of_the_bag() {
    let folder = tempfile::tempdir().unwrap();
    let (bag, outside) = (
        folder.path().join("bag"),
        folder.path().join("outside.mcap"),
    );
    write(&bag, Storage::Mcap, Compression::None, 3, 0);
    fs::rename(storage_file(&bag), &outside).unwrap();
    let path = bag.join("metadata.yaml");
    let text = fs::read_to_string(&path).unwrap();
    for entry in ["../outside.mcap".to_owned(), outside.display().to_string()] {
        fs::write(&path, text.replace("bag_0.mcap", &entry)).unwrap();
        assert!(
            matches!(read(&bag), Err(BagError::PathTraversal { .. })),
            "{entry}"
        );
    }
}

#[test]
fn lengths_that_lie_are_refused_before_memory_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = write_foreign(
        folder.path(),
        mcap::WriteOptions::new().use_chunks(false),
        "cdr",
    );
    let bytes = fs::read(&path).unwrap();
    let place = bytes
        .windows(9)
        .position(|w| w[0] == 5 && w[1..] == 116_u64.to_le_bytes())
        .unwrap();
    for len in [u64::MAX, 1 << 40, (1 << 30) + 23, 21] {
        let mut bent = bytes.clone();
        bent[place + 1..place + 9].copy_from_slice(&len.to_le_bytes());
        fs::write(&path, &bent).unwrap();
        let (some, error) = read_some(&path);
        assert!(some.is_empty());
        assert!(
            matches!(
                error,
                Some(BagError::Truncated { .. } | BagError::Corrupt { .. })
            ),
            "{len}: {error:?}"
        );
    }
}

/// The tables of ROS 2 Foxy, which has neither schema nor definitions.
fn write_old(folder: &TempDir, has_qos: bool, has_index: bool) -> PathBuf {
    let path = folder.path().join(format!("old_{has_qos}_{has_index}.db3"));
    let connection = Connection::open(&path).unwrap();
    let qos = if has_qos {
        ", offered_qos_profiles TEXT NOT NULL"
    } else {
        ""
    };
    let index = if has_index {
        "CREATE INDEX timestamp_idx ON messages(timestamp ASC);"
    } else {
        ""
    };
    let sql = format!(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, \
         serialization_format TEXT NOT NULL{qos}); \
         CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, \
         data BLOB NOT NULL); {index}"
    );
    connection.execute_batch(&sql).unwrap();
    let qos = if has_qos {
        ", '- {durability: 1, depth: 3}'"
    } else {
        ""
    };
    let insert = format!(
        "INSERT INTO topics VALUES (7, '/tf_static', 'tf2_msgs/msg/TFMessage', 'cdr'{qos})"
    );
    connection.execute(&insert, []).unwrap();
    connection.execute_batch("BEGIN").unwrap();
    for i in 0..9000_i64 {
        // Every time comes three times, across the pages of keys.
        let time_ns = T0_NS + (8999 - i) / 3;
        connection
            .execute(
                "INSERT INTO messages(topic_id, timestamp, data) VALUES (7, ?1, ?2)",
                (time_ns, cdr(i, 3)),
            )
            .unwrap();
    }
    connection.execute_batch("COMMIT").unwrap();
    path
}

#[test]
fn old_sqlite_schemas_read_and_leave_no_trace() {
    let folder = tempfile::tempdir().unwrap();
    for (has_qos, has_index) in [(false, true), (true, true), (true, false)] {
        let path = write_old(&folder, has_qos, has_index);
        let before = fs::read_dir(&folder).unwrap().count();
        let reader = BagReader::open(&path).unwrap();
        let messages = read(&path).unwrap();
        assert_eq!((messages.len(), reader.message_count()), (9000, 9000));
        assert!(messages.is_sorted_by_key(|m| m.log_time_ns));
        assert!(reader.topics()[0].is_latched());
        assert_eq!(reader.topics()[0].definition, None);
        assert_eq!(
            fs::read_dir(&folder).unwrap().count(),
            before,
            "files appeared beside the database"
        );
        let window = ReadOptions {
            start_ns: Some(T0_NS + 10),
            end_ns: Some(T0_NS + 12),
            ..ReadOptions::default()
        };
        assert_eq!(reader.messages(&window).unwrap().count(), 6);
    }
}

#[test]
fn an_unfinished_sqlite_recording_reads_from_its_log() {
    let folder = tempfile::tempdir().unwrap();
    let path = write_old(&folder, true, true);
    let connection = Connection::open(&path).unwrap();
    connection
        .pragma_update(None, "journal_mode", "WAL")
        .unwrap();
    connection
        .execute(
            "INSERT INTO messages(topic_id, timestamp, data) VALUES (7, ?1, ?2)",
            (T0_NS + 99_999, cdr(0, 3)),
        )
        .unwrap();
    assert_eq!(read(&path).unwrap().len(), 9001);
}

#[test]
fn topics_not_in_the_bag_are_an_error_that_lists_them() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag");
    write(&bag, Storage::Mcap, Compression::None, 3, 0);
    let options = ReadOptions {
        topics: Some(vec!["/c".into()]),
        ..ReadOptions::default()
    };
    let told = BagReader::open(&bag)
        .unwrap()
        .messages(&options)
        .err()
        .unwrap()
        .to_string();
    assert!(told.contains("/c") && told.contains("/a, /b"), "{told}");
}

#[test]
fn only_bags_are_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag");
    let create = |overwrite| {
        let options = WriterOptions {
            overwrite,
            ..WriterOptions::default()
        };
        BagWriter::create(&bag, Storage::Sqlite3, options).and_then(BagWriter::finish)
    };
    create(false).unwrap();
    assert!(
        create(false)
            .unwrap_err()
            .to_string()
            .contains("allow to overwrite")
    );
    create(true).unwrap();
    fs::write(bag.join("thesis.tex"), "years of work").unwrap();
    assert!(create(true).unwrap_err().to_string().contains("thesis.tex"));
    assert!(bag.join("thesis.tex").exists() && bag.join("metadata.yaml").exists());
    let file = folder.path().join("file");
    fs::write(&file, "x").unwrap();
    let options = WriterOptions {
        overwrite: true,
        ..WriterOptions::default()
    };
    assert!(matches!(
        BagWriter::create(&file, Storage::Mcap, options),
        Err(BagError::Exists { .. })
    ));
}

#[test]
fn the_writer_refuses_what_no_reader_could_use() {
    let folder = tempfile::tempdir().unwrap();
    let chunks = WriterOptions {
        compression: Compression::ZstdChunk,
        ..WriterOptions::default()
    };
    assert!(BagWriter::create(&folder.path().join("s"), Storage::Sqlite3, chunks).is_err());
    let mut writer = BagWriter::create(&folder.path().join("m"), Storage::Mcap, chunks).unwrap();
    let named = |name: &str, type_name: &str| TopicSpec {
        type_name: type_name.into(),
        ..spec(name, false)
    };
    assert!(
        writer
            .add_topic(named("relative", "std_msgs/msg/String"))
            .is_err()
    );
    assert!(writer.add_topic(named("/a", "std_msgs/String")).is_err());
    assert_eq!(writer.add_topic(spec("/a", false)).unwrap(), 0);
    assert!(writer.add_topic(spec("/a", false)).is_err());
    assert!(writer.write(0, -1, &cdr(0, 4)).is_err());
    assert!(writer.write(1, 0, &cdr(0, 4)).is_err());
    assert!(writer.write(0, 0, b"abc").is_err());
    assert_eq!(writer.finish().unwrap().message_count, 0);
}
