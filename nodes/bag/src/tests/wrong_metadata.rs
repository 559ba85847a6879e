//! Metadata that says other than the storage files: theirs is taken.

use super::*;

/// Counts of the topics, and of all.
fn counts(path: &Path) -> (Vec<u64>, u64) {
    let reader = BagReader::open(path).unwrap();
    let topics = reader.topics().iter().map(|topic| topic.message_count);
    (topics.collect(), reader.message_count())
}

#[test]
fn the_storage_counts_its_messages() {
    let folder = tempfile::tempdir().unwrap();
    for (storage, packing) in ALL {
        let bag = folder.path().join("bag");
        let written = write(&bag, storage, packing, 40, 0);
        assert_eq!(BagReader::open(&bag).unwrap().miscounted(), None);
        let whole = Metadata::read(&bag.join("metadata.yaml")).unwrap();
        // Counts of nothing, of too much, swapped, and of one topic only.
        for (of_topics, of_all) in [
            ([0, 0], 0),
            ([0, 0], 40),
            ([900, 900], 1800),
            ([1, 39], 40),
            ([0, 20], 20),
        ] {
            let mut metadata = whole.clone();
            metadata.message_count = of_all;
            for (topic, count) in metadata.topics_with_message_count.iter_mut().zip(of_topics) {
                topic.message_count = count;
            }
            metadata.files[0].message_count = of_all;
            fs::write(bag.join("metadata.yaml"), metadata.to_text().unwrap()).unwrap();
            let shown = format!("{storage:?} {packing:?} {of_topics:?} {of_all}");
            assert_eq!(counts(&bag), (vec![20, 20], 40), "{shown}");
            let reader = BagReader::open(&bag).unwrap();
            assert_eq!(reader.miscounted(), Some(of_all), "{shown}");
            assert_eq!(reader.end_ns(), Some(T0_NS + 39 * SECOND_NS / 10));
            assert_eq!(read(&bag).unwrap(), written, "{shown}");
        }
    }
}

/// A file that would stay closed is opened where the counts of the first one, or of all, are wrong.
#[test]
fn compressed_files_are_opened_where_the_counts_are_not_credible() {
    let folder = tempfile::tempdir().unwrap();
    let (one, two) = (folder.path().join("one"), folder.path().join("two"));
    write(&one, Storage::Mcap, Packing::File, 30, 0);
    write(&two, Storage::Mcap, Packing::File, 30, 30);
    let second = Metadata::read(&two.join("metadata.yaml")).unwrap();
    let name = second.relative_file_paths[0].clone();
    fs::copy(two.join(&name), one.join(&name)).unwrap();
    let change = |first: u64, second_count: u64, topics: u64| {
        change_metadata(&one, &one, |metadata| {
            metadata.relative_file_paths.truncate(1);
            metadata.relative_file_paths.push(name.clone());
            metadata.files.truncate(1);
            metadata.files.push(second.files[0].clone());
            metadata.files[0].message_count = first;
            metadata.files[1].message_count = second_count;
            metadata.message_count = 60;
            for topic in &mut metadata.topics_with_message_count {
                topic.message_count = topics;
            }
        });
    };
    change(30, 30, 30);
    assert_eq!(counts(&one), (vec![30, 30], 60));
    let is_lazy = || BagReader::open(&one).unwrap().miscounted().is_none();
    assert!(is_lazy());
    for (first, second, topics) in [(29, 31, 30), (30, 30, 0), (30, 0, 30)] {
        change(first, second, topics);
        assert_eq!(
            counts(&one),
            (vec![30, 30], 60),
            "{first} {second} {topics}"
        );
        assert_eq!(read(&one).unwrap().len(), 60);
    }
}

#[test]
fn the_storage_files_tell_their_kind() {
    let folder = tempfile::tempdir().unwrap();
    for (storage, packing) in ALL {
        let bag = folder.path().join("bag");
        let written = write(&bag, storage, packing, 6, 0);
        let text = fs::read_to_string(bag.join("metadata.yaml")).unwrap();
        let named = format!("storage_identifier: {}", storage.identifier());
        assert!(text.contains(&named));
        for identifier in ["''", "null", "~", "my_plugin", "rosbag_v2"] {
            let changed = text.replace(&named, &format!("storage_identifier: {identifier}"));
            fs::write(bag.join("metadata.yaml"), changed).unwrap();
            assert_eq!(read(&bag).unwrap(), written, "{storage:?} {identifier}");
        }
        fs::write(bag.join("metadata.yaml"), text.replace(&named, "x: y")).unwrap();
        assert_eq!(read(&bag).unwrap(), written, "without an identifier");
    }
    // Of another kind, by its first bytes.
    let bag = folder.path().join("bag");
    fs::write(storage_file(&bag), b"\x89PNG\r\n\x1a\n").unwrap();
    let error = read(&bag).unwrap_err().to_string();
    assert!(error.contains("a PNG image"), "{error}");
}

#[test]
fn counts_that_are_no_counts_and_lists_that_are_not_there_are_passed_over() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag");
    let written = write(&bag, Storage::Mcap, Packing::None, 6, 0);
    let text = fs::read_to_string(bag.join("metadata.yaml")).unwrap();
    for (old, new) in [
        ("  message_count: 6\n", "  message_count: -1\n"),
        ("  message_count: 6\n", "  message_count: many\n"),
        ("  message_count: 6\n", ""),
        ("version: 9", "version: 9 # \u{e4}"),
    ] {
        assert!(text.contains(old), "{old} in {text}");
        fs::write(bag.join("metadata.yaml"), text.replacen(old, new, 1)).unwrap();
        assert_eq!(read(&bag).unwrap(), written, "{new}");
        assert_eq!(counts(&bag), (vec![3, 3], 6), "{new}");
    }
    // A byte order mark, with the line ends of the editor that writes it.
    let marked = format!("\u{feff}{}", text.replace('\n', "\r\n"));
    fs::write(bag.join("metadata.yaml"), marked).unwrap();
    assert_eq!(read(&bag).unwrap(), written);
}

#[test]
fn files_that_were_renamed_are_found_in_the_folder() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag");
    let written = write(&bag, Storage::Sqlite3, Packing::None, 6, 0);
    fs::rename(storage_file(&bag), bag.join("renamed.db3")).unwrap();
    assert_eq!(read(&bag).unwrap(), written);
    change_metadata(&bag, &bag, |metadata| metadata.relative_file_paths.clear());
    assert_eq!(read(&bag).unwrap(), written);
    fs::remove_file(bag.join("renamed.db3")).unwrap();
    assert_eq!(read(&bag).unwrap(), vec![], "a bag of no files");
    change_metadata(&bag, &bag, |metadata| {
        metadata.relative_file_paths.push("gone.db3".into());
    });
    let error = read(&bag).unwrap_err().to_string();
    assert!(error.contains("gone.db3"), "{error}");
}

#[test]
fn names_of_topics_begin_with_a_slash() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("relative.mcap");
    let file = std::io::BufWriter::new(fs::File::create(&path).unwrap());
    let mut writer = mcap::Writer::new(file).unwrap();
    let schema = writer
        .add_schema("tf2_msgs/msg/TFMessage", "ros2msg", b"")
        .unwrap();
    for (sequence, name) in ["tf_static", "/tf_static", "robot/tf_static"]
        .into_iter()
        .enumerate()
    {
        let channel = writer
            .add_channel(schema, name, "cdr", &Default::default())
            .unwrap();
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence: sequence as u32,
            log_time: T0_NS as u64,
            publish_time: T0_NS as u64,
        };
        writer.write_to_known_channel(&header, &cdr(1, 8)).unwrap();
    }
    writer.finish().unwrap();
    let reader = BagReader::open(&path).unwrap();
    let names = reader
        .topics()
        .iter()
        .map(|topic| (topic.name.as_str(), topic.message_count));
    let names: Vec<_> = names.collect();
    assert_eq!(names, [("/tf_static", 2), ("/robot/tf_static", 1)]);
    assert!(reader.topics().iter().all(TopicInfo::is_latched));
    assert_eq!(read(&path).unwrap().len(), 3);
}
