//! Bags written and read again.

mod damage;
mod foreign;
mod recover;
mod recover_packed;
mod wrong_metadata;

use std::{
    fs,
    path::{Path, PathBuf},
};

use super::{metadata::Metadata, *};

const SECOND_NS: i64 = 1_000_000_000;
const T0_NS: i64 = 1_700_000_000 * SECOND_NS;

const HASH: &str = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18";

pub(super) fn spec(name: &str, latched: bool) -> TopicSpec {
    TopicSpec {
        name: name.into(),
        type_name: "std_msgs/msg/String".into(),
        type_hash: HASH.into(),
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

/// Data that do not compress, with a CDR header.
pub(crate) fn noise(seed: u32, bytes: usize) -> Vec<u8> {
    let mut state = seed.wrapping_mul(2_654_435_761) | 1;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        (state >> 24) as u8
    };
    let data = (0..bytes).map(|_| next());
    [0, 1, 0, 0].into_iter().chain(data).collect()
}

/// Compression of a bag by means of rosbag2.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Packing {
    None,
    Message,
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
    let options = WriterOptions {
        overwrite: true,
        ..WriterOptions::default()
    };
    let mut writer = BagWriter::create(folder, storage, options).unwrap();
    writer.add_topic(spec("/a", false)).unwrap();
    writer.add_topic(spec("/b", false)).unwrap();
    let mut messages = Vec::new();
    for i in first..first + count {
        let data = cdr(i, 40 + (i % 13) as usize * 20);
        let (topic, log_time_ns) = ((i % 2) as usize, T0_NS + i * SECOND_NS / 10);
        let written = match packing {
            Packing::Message => zstd::encode_all(&data[..], 0).unwrap(),
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
    change_metadata(folder, folder, |metadata| {
        metadata.compression_format = "zstd".into();
        metadata.compression_mode = format!("{packing:?}");
        if packing == Packing::File {
            let file = storage_file(folder);
            let whole = fs::read(&file).unwrap();
            let packed = zstd::encode_all(&whole[..], 0).unwrap();
            fs::write(format!("{}.zstd", file.display()), packed).unwrap();
            fs::remove_file(&file).unwrap();
            metadata.relative_file_paths[0] += ".zstd";
            metadata.files[0].path += ".zstd";
        }
    });
}

/// Writes the changed metadata of one bag into another.
fn change_metadata(from: &Path, to: &Path, change: impl FnOnce(&mut Metadata)) {
    let mut metadata = Metadata::read(&from.join("metadata.yaml")).unwrap();
    change(&mut metadata);
    fs::write(to.join("metadata.yaml"), metadata.to_text().unwrap()).unwrap();
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
    (Storage::Mcap, Packing::Message),
    (Storage::Mcap, Packing::File),
    (Storage::Sqlite3, Packing::None),
    (Storage::Sqlite3, Packing::Message),
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
        let bare = BagReader::open(&storage_file(&bag)).unwrap();
        assert!(reader.topics()[0].type_hash == HASH && bare.topics()[1].type_hash == HASH);
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
        let messages = read(&bag).unwrap();
        let times = messages.iter().map(|m| m.log_time_ns - T0_NS);
        assert!(times.eq(0..20));
    }
}

#[test]
fn an_empty_bag_is_no_error() {
    let folder = tempfile::tempdir().unwrap();
    for (storage, packing) in ALL {
        let bag = folder.path().join("bag");
        assert_eq!(write(&bag, storage, packing, 0, 0), vec![]);
        let reader = BagReader::open(&bag).unwrap();
        assert_eq!((reader.start_ns(), reader.message_count()), (None, 0));
        assert_eq!(reader.topics().len(), 2);
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
        fs::create_dir(&both).unwrap();
        change_metadata(&one, &both, |metadata| {
            metadata.relative_file_paths.clear();
            metadata.files.clear();
            for bag in [&two, &one] {
                let listed = Metadata::read(&bag.join("metadata.yaml")).unwrap();
                for name in listed.relative_file_paths {
                    fs::copy(bag.join(&name), both.join(&name)).unwrap();
                    metadata.relative_file_paths.push(name);
                }
                metadata.files.extend(listed.files);
            }
        });
        let by_time = |messages: Vec<BagMessage>| {
            let pairs = messages.into_iter().map(|m| (m.log_time_ns, m.data));
            pairs.collect::<Vec<_>>()
        };
        let (mut found, mut wanted) = (by_time(read(&both).unwrap()), by_time(expected));
        assert!(found.is_sorted_by_key(|m| m.0), "{storage:?} {packing:?}");
        found.sort();
        wanted.sort();
        assert_eq!(found, wanted, "{storage:?} {packing:?}");
        fs::remove_file(both.join("metadata.yaml")).unwrap();
        assert_eq!(read(&both).unwrap().len(), 60);
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
    let messages = BagReader::open(&bag).unwrap().messages(&options);
    let error = messages.err().unwrap().to_string();
    assert!(error.contains("/c") && error.contains("/a, /b"), "{error}");
}

#[test]
fn only_bags_are_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag");
    let create = |path: &Path, overwrite| {
        BagWriter::create(
            path,
            Storage::Sqlite3,
            WriterOptions {
                overwrite,
                ..WriterOptions::default()
            },
        )
        .and_then(BagWriter::finish)
    };
    let refused = |path: &Path, overwrite| match create(path, overwrite) {
        Err(error @ BagError::Exists { .. }) => error.to_string(),
        other => panic!("{other:?}"),
    };
    create(&bag, false).unwrap();
    assert!(refused(&bag, false).contains("allow to overwrite"));
    create(&bag, true).unwrap();
    for name in ["thesis.tex", "bag_0.db3-wal.zstd"] {
        let foreign = bag.join(name);
        fs::write(&foreign, "years of work").unwrap();
        assert!(refused(&bag, true).contains(name));
        assert!(foreign.exists() && bag.join("metadata.yaml").exists());
        fs::remove_file(foreign).unwrap();
    }
    let others = bag.join("years_of_work.db3");
    fs::write(&others, "not of this bag").unwrap();
    assert!(refused(&bag, true).contains("years_of_work.db3"));
    fs::write(bag.join("metadata.yaml"), "not of a bag").unwrap();
    assert!(refused(&bag, true).contains("not recognised as a bag"));
    fs::remove_file(bag.join("metadata.yaml")).unwrap();
    refused(&bag, true);
    assert!(others.exists() && bag.join("bag_0.db3").exists());
    fs::remove_file(others).unwrap();
    // As a writer that was killed leaves it.
    create(&bag, true).unwrap();
    let file = folder.path().join("file");
    fs::write(&file, "x").unwrap();
    refused(&file, true);
}

#[test]
fn the_writer_refuses_what_no_reader_could_use() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m");
    let mut writer = BagWriter::create(&path, Storage::Mcap, WriterOptions::default()).unwrap();
    let mut add = |name: &str, type_name: &str| {
        writer.add_topic(TopicSpec {
            type_name: type_name.into(),
            ..spec(name, false)
        })
    };
    assert!(add("relative", "std_msgs/msg/String").is_err());
    assert!(add("/a", "std_msgs/String").is_err());
    assert_eq!(add("/a", "std_msgs/msg/String").unwrap(), 0);
    assert!(add("/a", "std_msgs/msg/String").is_err());
    for (topic, time_ns, cdr) in [
        (0, -1, cdr(0, 4)),
        (1, 0, cdr(0, 4)),
        (0, 0, b"abc".to_vec()),
    ] {
        assert!(writer.write(topic, time_ns, &cdr).is_err());
    }
    writer.finish().unwrap();
}
