//! Bags of other writers and of older versions, and files that are no bags.

use std::collections::BTreeMap;

use mcap::records::MessageHeader;
use rusqlite::Connection;
use tempfile::TempDir;

use super::*;

/// An MCAP file as programs other than rosbag2 write it; several chunks where there are any.
pub(super) fn write_foreign(
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
fn foreign_files_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        let error = BagReader::open(&path).err().unwrap().to_string();
        assert!(error.contains(name), "{error}");
        error
    };
    assert!(refused("image.mcap", b"\x89PNG\r\n\x1a\n0000").contains("a PNG image"));
    assert!(refused("empty.db3", b"").contains("empty"));
    let (protobuf, _) = write_foreign(folder.path(), mcap::WriteOptions::new(), "protobuf");
    let error = read(&protobuf).unwrap_err().to_string();
    let expected = "an MCAP file of protobuf messages";
    assert!(error.contains(expected), "{error}");

    let database = |name: &str, sql: &str| {
        let path = folder.path().join(name);
        Connection::open(&path).unwrap().execute_batch(sql).unwrap();
        read(&path).unwrap_err()
    };
    let other = database("other.db3", "CREATE TABLE people(name TEXT);");
    assert!(other.to_string().contains("people"));
    // A view could hide an endless query.
    let sql = "CREATE TABLE topics(id, name, type, serialization_format); \
               CREATE VIEW messages AS SELECT 1;";
    assert!(matches!(
        database("view.db3", sql),
        BagError::Foreign { .. }
    ));

    let nothing = folder.path().join("nothing");
    fs::create_dir(&nothing).unwrap();
    let error = read(&nothing).unwrap_err().to_string();
    assert!(error.contains("without metadata.yaml"));
    let missing = read(&folder.path().join("missing"));
    assert!(matches!(missing, Err(BagError::Io { .. })));
}

#[test]
fn metadata_cannot_lead_out_of_the_bag() {
    let folder = tempfile::tempdir().unwrap();
    let [bag, outside] = ["bag", "outside.mcap"].map(|name| folder.path().join(name));
    write(&bag, Storage::Mcap, Packing::None, 3, 0);
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

/// The tables of ROS 2 Foxy, which has neither schema nor definitions.
fn write_old(folder: &TempDir, has_qos: bool, has_index: bool) -> PathBuf {
    let path = folder.path().join(format!("old_{has_qos}_{has_index}.db3"));
    let connection = Connection::open(&path).unwrap();
    let (column, value) = match has_qos {
        true => (
            ", offered_qos_profiles TEXT NOT NULL",
            ", '- {durability: 1, depth: 3}'",
        ),
        false => ("", ""),
    };
    let index = match has_index {
        true => "CREATE INDEX timestamp_idx ON messages(timestamp ASC);",
        false => "",
    };
    let sql = format!(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, \
         serialization_format TEXT NOT NULL{column}); \
         CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, \
         data BLOB NOT NULL); {index} \
         INSERT INTO topics VALUES (7, '/tf_static', 'tf2_msgs/msg/TFMessage', 'cdr'{value}); BEGIN;"
    );
    connection.execute_batch(&sql).unwrap();
    let insert = "INSERT INTO messages(topic_id, timestamp, data) VALUES (7, ?1, ?2)";
    for i in 0..9000_i64 {
        // Every time comes three times, across the pages of keys.
        let time_ns = T0_NS + (8999 - i) / 3;
        connection.execute(insert, (time_ns, cdr(i, 3))).unwrap();
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
fn a_recorder_stopped_while_it_copies_its_log_leaves_all_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = write_old(&folder, true, true);
    let connection = Connection::open(&path).unwrap();
    connection
        .execute_batch("PRAGMA journal_mode = WAL; PRAGMA wal_autocheckpoint = 0;")
        .unwrap();
    for i in 0..100 {
        let insert = "INSERT INTO messages(topic_id, timestamp, data) VALUES (7, ?1, ?2)";
        let time_ns = T0_NS + 99_999 + i;
        connection.execute(insert, (time_ns, cdr(i, 5000))).unwrap();
    }
    let stopped = folder.path().join("stopped.db3");
    fs::copy(&path, &stopped).unwrap();
    let wal = |path: &Path| format!("{}-wal", path.display());
    fs::copy(wal(&path), wal(&stopped)).unwrap();
    connection
        .execute_batch("PRAGMA wal_checkpoint(TRUNCATE)")
        .unwrap();
    // The first page is copied first, and counts pages that the file does not have yet.
    let mut file = fs::OpenOptions::new().write(true).open(&stopped).unwrap();
    let first_page = &fs::read(&path).unwrap()[..4096];
    std::io::Write::write_all(&mut file, first_page).unwrap();
    assert_eq!(read(&stopped).unwrap(), read(&path).unwrap());
    assert_eq!(read(&stopped).unwrap().len(), 9100);
}
