//! Bags written and read again.

mod damage;
mod foreign;

use std::{
    fs,
    path::{Path, PathBuf},
};

use super::*;

const SECOND_NS: i64 = 1_000_000_000;
const T0_NS: i64 = 1_700_000_000 * SECOND_NS;

pub(super) fn spec(name: &str, latched: bool) -> TopicSpec {
    TopicSpec {
        name: name.into(),
        type_name: "std_msgs/msg/String".into(),
        definition: Some("string data\n".into()),
        offered_qos: vec![BagQos {
            depth: 1,
            latched,
            ..BagQos::default()
        }],
    }
}

pub(super) fn cdr(seed: i64, len: usize) -> Vec<u8> {
    let mut data = vec![0, 1, 0, 0];
    data.extend((0..len).map(|i| (i as i64 * 31 + seed * 7).rem_euclid(251) as u8));
    data
}

/// Compression of a bag by means of rosbag2.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Packing {
    None,
    Messages,
    File,
}

/// `count` messages at 10 Hz on "/a" and "/b" in turn.
fn write(
    folder: &Path,
    storage: Storage,
    packing: Packing,
    count: i64,
    first: i64,
) -> Vec<BagMessage> {
    let options = WriterOptions { overwrite: true };
    let mut writer = BagWriter::create(folder, storage, options).unwrap();
    writer.add_topic(spec("/a", false)).unwrap();
    writer.add_topic(spec("/b", false)).unwrap();
    let mut messages = Vec::new();
    for i in first..first + count {
        let data = cdr(i, 40 + (i % 13) as usize * 20);
        let (topic, log_time_ns) = ((i % 2) as usize, T0_NS + i * SECOND_NS / 10);
        let written = match packing {
            Packing::Messages => zstd::encode_all(&data[..], 0).unwrap(),
            _ => data.clone(),
        };
        writer.write(topic, log_time_ns, &written).unwrap();
        messages.push(BagMessage {
            topic,
            log_time_ns,
            data,
        });
    }
    writer.finish().unwrap();
    if packing != Packing::None {
        pack(folder, packing);
    }
    messages
}

/// Notes the compression in the metadata, and compresses the storage file.
fn pack(folder: &Path, packing: Packing) {
    let metadata = folder.join("metadata.yaml");
    let mut text = fs::read_to_string(&metadata)
        .unwrap()
        .replace("compression_format: ''", "compression_format: zstd");
    if packing == Packing::Messages {
        text = text.replace("compression_mode: ''", "compression_mode: message");
    } else {
        let file = storage_file(folder);
        let packed = format!("{}.zstd", file.display());
        fs::write(
            &packed,
            zstd::encode_all(&fs::read(&file).unwrap()[..], 0).unwrap(),
        )
        .unwrap();
        fs::remove_file(&file).unwrap();
        let name = file.file_name().unwrap().to_str().unwrap();
        text = text
            .replace("compression_mode: ''", "compression_mode: file")
            .replace(name, &format!("{name}.zstd"));
    }
    fs::write(&metadata, text).unwrap();
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

/// The readable messages, and the error behind them.
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

const ALL: [(Storage, Packing); 6] = [
    (Storage::Mcap, Packing::None),
    (Storage::Mcap, Packing::Messages),
    (Storage::Mcap, Packing::File),
    (Storage::Sqlite3, Packing::None),
    (Storage::Sqlite3, Packing::Messages),
    (Storage::Sqlite3, Packing::File),
];

#[test]
fn every_storage_and_compression_round_trips() {
    let folder = tempfile::tempdir().unwrap();
    for (storage, packing) in ALL {
        let bag = folder.path().join("a bag with ? and % and # in its name");
        let written = write(&bag, storage, packing, 200, 0);
        assert_eq!(read(&bag).unwrap(), written, "{storage:?} {packing:?}");
        assert_eq!(
            read(&storage_file(&bag)).unwrap(),
            written,
            "{storage:?} {packing:?} bare"
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
    for (storage, packing) in ALL {
        let bag = folder.path().join("bag");
        assert_eq!(write(&bag, storage, packing, 0, 0), vec![]);
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
    for (storage, packing) in ALL {
        let (one, two, both) = (
            folder.path().join("one"),
            folder.path().join("two"),
            folder.path().join("both"),
        );
        let mut expected = write(&one, storage, packing, 30, 0);
        // The second starts before the first ends.
        expected.extend(write(&two, storage, packing, 30, 25));
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
        assert!(found.is_sorted_by_key(|m| m.0), "{storage:?} {packing:?}");
        let mut wanted: Vec<_> = expected
            .iter()
            .map(|m| (m.log_time_ns, m.data.clone()))
            .collect();
        found.sort();
        wanted.sort();
        assert_eq!(found, wanted, "{storage:?} {packing:?}");
        fs::remove_file(both.join("metadata.yaml")).unwrap();
        assert_eq!(by_time(&both).len(), 60);
        fs::remove_dir_all(&both).unwrap();
    }
}

#[test]
fn topics_not_in_the_bag_are_an_error_that_lists_them() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag");
    write(&bag, Storage::Mcap, Packing::None, 3, 0);
    let options = ReadOptions {
        topics: Some(vec!["/c".into()]),
        ..ReadOptions::default()
    };
    let error = BagReader::open(&bag)
        .unwrap()
        .messages(&options)
        .err()
        .unwrap()
        .to_string();
    assert!(error.contains("/c") && error.contains("/a, /b"), "{error}");
}

#[test]
fn only_bags_are_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag");
    let create = |overwrite| {
        BagWriter::create(&bag, Storage::Sqlite3, WriterOptions { overwrite })
            .and_then(BagWriter::finish)
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
    let options = WriterOptions { overwrite: true };
    assert!(matches!(
        BagWriter::create(&file, Storage::Mcap, options),
        Err(BagError::Exists { .. })
    ));
}

#[test]
fn the_writer_refuses_what_no_reader_could_use() {
    let folder = tempfile::tempdir().unwrap();
    let mut writer = BagWriter::create(
        &folder.path().join("m"),
        Storage::Mcap,
        WriterOptions::default(),
    )
    .unwrap();
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
    writer.finish().unwrap();
}
