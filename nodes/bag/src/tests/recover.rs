//! Damaged and hostile bags: recovered, counted, opened.

use std::collections::BTreeMap;

use rusqlite::Connection;

use super::{foreign::write_foreign, *};

#[test]
fn messages_of_a_damaged_chunk_are_taken_unchecked() {
    let folder = tempfile::tempdir().unwrap();
    let options = mcap::WriteOptions::new().compression(None);
    let (path, written) = write_foreign(folder.path(), options, "cdr");
    let mut bytes = fs::read(&path).unwrap();
    let needle = &written[5].data[50..80];
    let place = bytes.windows(30).position(|window| window == needle);
    bytes[place.unwrap()] ^= 0x10;
    fs::write(&path, &bytes).unwrap();
    assert!(read_some(&path).1.is_some());
    let out = folder.path().join("sound");
    let recovered = recover(&path, &out).unwrap();
    let sound = read(&out).unwrap();
    assert_eq!((recovered.messages, sound.len()), (12, 12));
    assert_eq!((recovered.claimed, recovered.damages), (Some(12), 1));
    assert_eq!(recovered.lost, Some(0));
    check_unchecked(&recovered, &sound, &written);
    assert!(recover(&path, &out).is_err(), "nothing is replaced");
}

/// Only messages that are marked differ, which are those of one chunk: no more than three here.
fn check_unchecked(recovered: &Recovered, sound: &[BagMessage], written: &[BagMessage]) {
    let [
        Unchecked {
            topic,
            log_times_ns,
        },
    ] = &recovered.unchecked[..]
    else {
        panic!("{recovered:?}")
    };
    assert_eq!(topic, "/a");
    assert!((1..=3).contains(&log_times_ns.len()), "{recovered:?}");
    let (marked, checked): (Vec<_>, Vec<_>) = sound
        .iter()
        .partition(|message| log_times_ns.contains(&message.log_time_ns));
    assert_eq!(marked.len(), log_times_ns.len());
    assert!(checked.iter().all(|message| written.contains(message)));
}

#[test]
fn cut_bags_of_either_storage_give_what_precedes_the_cut() {
    let folder = tempfile::tempdir().unwrap();
    for (storage, packing) in ALL {
        let bag = folder.path().join(format!("bag{storage:?}{packing:?}"));
        let written = write(&bag, storage, packing, 1000, 0);
        if packing == Packing::File {
            continue;
        }
        let file = storage_file(&bag);
        let whole = fs::read(&file).unwrap();
        fs::write(&file, &whole[..whole.len() * 2 / 3]).unwrap();
        fs::write(bag.join("metadata.yaml"), "[".repeat(40_000)).unwrap();
        assert!(read(&bag).is_err());
        let out = folder.path().join(format!("{storage:?}{packing:?}"));
        let recovered = recover(&bag, &out).unwrap();
        let told = recovered.told.join("\n");
        assert!(told.contains("more than 64 brackets"), "{told}");
        assert!(recovered.damages > 1, "{:?}", recovered.told);
        let sound = read(&out).unwrap();
        assert_eq!(sound, written[..sound.len()], "{storage:?} {packing:?}");
        assert_eq!(recovered.messages, sound.len() as u64);
        assert!(sound.len() > 400, "{storage:?} {packing:?} {}", sound.len());
        let told = recovered.told.join("\n");
        assert!(!told.contains("bag recover"), "{told}");
        assert!(recovered.lost != Some(0), "{recovered:?}");
        let name = file.extension().unwrap();
        assert_eq!(storage_file(&out).extension().unwrap(), name);
    }
}

#[test]
fn rows_that_are_no_messages_are_left_out_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag");
    let written = write(&bag, Storage::Sqlite3, Packing::None, 60, 0);
    let connection = Connection::open(storage_file(&bag)).unwrap();
    let flips = "UPDATE messages SET topic_id = 4711 WHERE id = 3; \
                 UPDATE messages SET timestamp = -timestamp WHERE id = 7; \
                 UPDATE messages SET timestamp = 'soon' WHERE id = 9; \
                 UPDATE messages SET topic_id = 'x' WHERE id = 11; \
                 UPDATE messages SET data = x'00' WHERE id = 20;";
    connection.execute_batch(flips).unwrap();
    connection.close().unwrap();
    let reader = BagReader::open(&bag).unwrap();
    assert_eq!((reader.message_count(), reader.implausible_rows()), (55, 5));
    assert_eq!(reader.start_ns(), Some(T0_NS));
    let found = read(&bag).unwrap();
    assert!(found.len() == 55 && found.iter().all(|message| written.contains(message)));
    let out = folder.path().join("sound");
    let recovered = recover(&bag, &out).unwrap();
    assert_eq!((recovered.messages, recovered.refused), (55, 5));
}

#[test]
fn a_count_of_the_metadata_shows_what_was_lost() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag");
    write(&bag, Storage::Mcap, Packing::None, 30, 0);
    change_metadata(&bag, &bag, |metadata| metadata.message_count = 40);
    let recovered = recover(&bag, &folder.path().join("sound")).unwrap();
    assert_eq!((recovered.messages, recovered.claimed), (30, Some(40)));
}

#[test]
fn counts_that_metadata_claim_are_not_believed() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag");
    let written = write(&bag, Storage::Mcap, Packing::None, 30, 0);
    change_metadata(&bag, &bag, |metadata| {
        metadata.message_count = u64::MAX;
        metadata.files[0].message_count = u64::MAX;
        metadata.topics_with_message_count[0].message_count = u64::MAX;
    });
    assert_eq!(BagReader::open(&bag).unwrap().message_count(), 30);
    assert_eq!(read(&bag).unwrap(), written);
}

#[test]
fn many_channels_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("many.mcap");
    let file = std::io::BufWriter::new(fs::File::create(&path).unwrap());
    let mut writer = mcap::WriteOptions::new().create(file).unwrap();
    let schema = writer.add_schema("std_msgs/String", "ros2msg", b"string data");
    let schema = schema.unwrap();
    for i in 0..32_000 {
        let topic = format!("/a_long_common_beginning_of_the_name_of_a_topic/{i}");
        let channel = writer.add_channel(schema, &topic, "cdr", &BTreeMap::new());
        let header = mcap::records::MessageHeader {
            channel_id: channel.unwrap(),
            sequence: 0,
            log_time: i,
            publish_time: i,
        };
        writer.write_to_known_channel(&header, &cdr(0, 4)).unwrap();
    }
    writer.finish().unwrap();
    // A minute, while each was compared with all.
    assert_eq!(read(&path).unwrap().len(), 32_000);
}

#[test]
fn sound_chunks_behind_damage_are_found_without_an_index() {
    let folder = tempfile::tempdir().unwrap();
    let options = mcap::WriteOptions::new().compression(None);
    let (path, written) = write_foreign(folder.path(), options, "cdr");
    let whole = fs::read(&path).unwrap();
    let needle = &written[6].data[50..80];
    let place = whole
        .windows(30)
        .position(|window| window == needle)
        .unwrap();
    // Without its summary, and with a bit of a message or the length of a chunk in the middle wrong.
    let end = whole
        .windows(9)
        .rposition(|w| w == [15, 4, 0, 0, 0, 0, 0, 0, 0])
        .unwrap();
    let chunk = whole[..place].windows(9).rposition(|w| {
        let bytes = u64::from_le_bytes(w[1..].try_into().unwrap());
        w[0] == 6 && bytes > 40 && bytes < whole.len() as u64
    });
    let chunk = chunk.unwrap();
    for (number, at) in [place, chunk + 3].into_iter().enumerate() {
        let mut bytes = whole[..end].to_vec();
        bytes[at] ^= 0x50;
        fs::write(&path, &bytes).unwrap();
        let (before, error) = read_some(&path);
        assert!(error.is_some());
        let out = folder.path().join(format!("sound{number}"));
        let recovered = recover(&path, &out).unwrap();
        let sound = read(&out).unwrap();
        assert!(sound.len() > before.len(), "{recovered:?}");
        assert_eq!(sound.len(), 12);
        check_unchecked(&recovered, &sound, &written);
        assert_eq!(recovered.lost, None, "nothing counts them");
        assert_eq!(recovered.damages, 1, "{:?}", recovered.told);
    }
}

#[test]
fn a_file_that_begins_with_damage_keeps_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let (one, two) = (folder.path().join("one"), folder.path().join("two"));
    write(&one, Storage::Mcap, Packing::None, 30, 0);
    let later = write(&two, Storage::Mcap, Packing::None, 30, 100);
    let bent = storage_file(&one);
    let mut bytes = fs::read(&bent).unwrap();
    let place = bytes.len() / 4;
    bytes[place] ^= 0x10;
    fs::write(&bent, &bytes).unwrap();
    let second = storage_file(&two);
    fs::copy(&second, one.join(second.file_name().unwrap())).unwrap();
    fs::remove_file(one.join("metadata.yaml")).unwrap();
    let options = ReadOptions {
        past_damage: true,
        ..ReadOptions::default()
    };
    let reader = BagReader::open(&one).unwrap();
    let mut messages = reader.messages(&options).unwrap();
    assert!(messages.next().unwrap().is_err(), "before what is later");
    let behind: Vec<_> = messages.collect::<Result<_, _>>().unwrap();
    assert!(behind.is_sorted_by_key(|message| message.log_time_ns));
    assert!((behind.len(), &behind[30..]) == (60, &later[..]));
}

#[cfg(unix)]
#[test]
fn links_out_of_a_bag_are_refused() {
    use std::os::unix::fs::symlink;
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag");
    let written = write(&bag, Storage::Mcap, Packing::None, 10, 0);
    let (file, outside) = (storage_file(&bag), folder.path().join("outside.mcap"));
    fs::rename(&file, &outside).unwrap();
    symlink(&outside, &file).unwrap();
    let refused = |found: Result<_, BagError>| matches!(found, Err(BagError::PathTraversal { .. }));
    assert!(refused(read(&bag)));
    fs::remove_file(bag.join("metadata.yaml")).unwrap();
    assert!(refused(read(&bag)));
    // A link inside, or to the whole bag, is none.
    fs::remove_file(&file).unwrap();
    fs::rename(&outside, bag.join("real")).unwrap();
    symlink("real", &file).unwrap();
    let link = folder.path().join("link");
    symlink(&bag, &link).unwrap();
    assert_eq!(read(&link).unwrap(), written);
}
