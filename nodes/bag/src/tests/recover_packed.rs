//! Damaged bags that are compressed: what precedes the damage is recovered, marked and counted.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::OnceLock;

use mcap::records::MessageHeader;
use proptest::prelude::*;

use super::*;

const MESSAGES: usize = 120;

/// An MCAP file of two chunks of 1.2 MB.
fn write_chunks(file: &Path, compression: Option<mcap::Compression>) -> Vec<BagMessage> {
    let options = mcap::WriteOptions::new()
        .compression(compression)
        .chunk_size(Some(1_200_000));
    let mut writer = options
        .create(std::io::BufWriter::new(fs::File::create(file).unwrap()))
        .unwrap();
    let schema = writer.add_schema("std_msgs/String", "ros2msg", b"string data");
    let schema = schema.unwrap();
    let channels = ["/a", "/b"].map(|topic| {
        let channel = writer.add_channel(schema, topic, "cdr", &BTreeMap::new());
        channel.unwrap()
    });
    let write = |i: usize| {
        let (topic, log_time_ns) = (i % 2, T0_NS + i as i64);
        let header = MessageHeader {
            channel_id: channels[topic],
            sequence: 0,
            log_time: log_time_ns as u64,
            publish_time: log_time_ns as u64,
        };
        let data = noise(i as u32, 20_000);
        writer.write_to_known_channel(&header, &data).unwrap();
        BagMessage {
            topic,
            log_time_ns,
            data,
        }
    };
    let written = (0..MESSAGES).map(write).collect();
    writer.finish().unwrap();
    written
}

/// Log times of the marked messages, by topic.
fn marked(recovered: &Recovered) -> BTreeSet<(String, i64)> {
    let of = |one: &Unchecked| {
        let topic = one.topic.clone();
        let times = one.log_times_ns.clone().into_iter();
        times.map(move |time_ns| (topic.clone(), time_ns))
    };
    recovered.unchecked.iter().flat_map(of).collect()
}

/// Recovers a bag; the result with the messages, each with whether it is marked.
fn recovered(bag: &Path, out: &Path) -> (Recovered, Vec<(BagMessage, bool)>) {
    let recovered = recover(bag, out).unwrap();
    let reader = BagReader::open(out).unwrap();
    let marked = marked(&recovered);
    let messages = reader.messages(&ReadOptions::default()).unwrap();
    let messages = messages.map(|message| {
        let message = message.unwrap();
        let topic = reader.topics()[message.topic].name.clone();
        let is_marked = marked.contains(&(topic, message.log_time_ns));
        (message, is_marked)
    });
    let messages = messages.collect();
    (recovered, messages)
}

#[test]
fn blocks_before_the_damage_of_a_compressed_chunk_are_taken_unchecked() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("log.mcap");
    for (kind, compression) in [mcap::Compression::Lz4, mcap::Compression::Zstd]
        .into_iter()
        .enumerate()
    {
        let written = write_chunks(&file, Some(compression));
        let whole = fs::read(&file).unwrap();
        let chunks = whole.windows(4).enumerate();
        let chunks = chunks.filter(|(_, w)| {
            [b"\x04\x22\x4d\x18", b"\x28\xb5\x2f\xfd"].contains(&<&[u8; 4]>::try_from(*w).unwrap())
        });
        let chunks: Vec<usize> = chunks.map(|(at, _)| at).collect();
        assert_eq!(chunks.len(), 2);
        let second = chunks[1] + 600_000;
        for (case, damage) in ["bent", "cut", "bent without index"]
            .into_iter()
            .enumerate()
        {
            let mut bytes = whole.clone();
            // The size of a block is wrong with the data that follow it.
            bytes[second..second + 140_000].fill(0xff);
            match damage {
                "cut" => bytes.truncate(second),
                "bent" => {}
                _ => bytes.truncate(bytes.len() - 20),
            }
            fs::write(&file, &bytes).unwrap();
            let out = folder.path().join(format!("sound{kind}{case}"));
            let (recovered, messages) = recovered(&file, &out);
            let name = format!("{damage}: {recovered:?}");
            // Of 60 messages before it, and about 30 of the chunk.
            assert!(
                (75..=92).contains(&messages.len()),
                "{} {name}",
                messages.len()
            );
            for (i, (message, is_marked)) in messages.iter().enumerate() {
                assert_eq!(*is_marked, i >= 60, "{i} {name}");
                // A block that did not compress is the data.
                let is_last = i + 1 == messages.len();
                assert!(*message == written[i] || is_last, "{i} {name}");
            }
            assert_eq!(recovered.damages, 1, "{name}");
            let claimed = (damage == "bent").then_some(MESSAGES as u64);
            let lost = claimed.map(|claimed| claimed - messages.len() as u64);
            assert_eq!(
                (recovered.claimed, recovered.lost),
                (claimed, lost),
                "{name}"
            );
        }
    }
}

#[test]
fn the_part_of_a_compressed_file_before_its_damage_is_recovered() {
    let folder = tempfile::tempdir().unwrap();
    for storage in [Storage::Mcap, Storage::Sqlite3] {
        let bag = folder.path().join(format!("{storage:?}"));
        let written = write_packed(&bag, storage, false);
        let file = storage_file(&bag);
        let whole = fs::read(&file).unwrap();
        for (case, is_cut) in [true, false].into_iter().enumerate() {
            let mut bytes = whole.clone();
            let half = bytes.len() / 2;
            match is_cut {
                true => bytes.truncate(half),
                false => bytes[half..].iter_mut().for_each(|byte| *byte = !*byte),
            }
            fs::write(&file, &bytes).unwrap();
            let (some, error) = read_some(&bag);
            assert!(some.len() > 30);
            let is_truncated = matches!(error, Some(BagError::Truncated { .. }));
            assert!(error.is_some() && is_truncated == is_cut, "{error:?}");
            let out = folder.path().join(format!("{storage:?}{case}"));
            let (recovered, messages) = recovered(&bag, &out);
            assert!(messages.len() >= some.len() && messages.len() < written.len());
            for ((message, is_marked), wanted) in messages.iter().zip(&written) {
                // Rows have no checksum, and chunks have one.
                assert!(*is_marked || storage == Storage::Mcap, "{recovered:?}");
                assert!(message == wanted || *is_marked, "{recovered:?}");
            }
            let sound = messages.iter().zip(&written);
            let sound = sound.take_while(|((message, _), wanted)| message == *wanted);
            assert!(sound.count() > 30, "{}", messages.len());
            let lost = (written.len() - messages.len()) as u64;
            assert_eq!(recovered.lost, Some(lost), "{:?}", recovered.told);
            assert!(recovered.damages > 0);
        }
    }
}

/// A bag whose file of noise is compressed, with or without a checksum of the frame.
fn write_packed(bag: &Path, storage: Storage, has_checksum: bool) -> Vec<BagMessage> {
    let mut writer = BagWriter::create(bag, storage, WriterOptions::default()).unwrap();
    for topic in ["/a", "/b"] {
        writer.add_topic(spec(topic, false)).unwrap();
    }
    let write = |i: usize| {
        let (topic, log_time_ns, data) = (i % 2, T0_NS + i as i64, noise(i as u32, 20_000));
        writer.write(topic, log_time_ns, &data).unwrap();
        BagMessage {
            topic,
            log_time_ns,
            data,
        }
    };
    let written = (0..MESSAGES).map(write).collect();
    writer.finish().unwrap();
    pack(bag, Packing::File);
    if has_checksum {
        let file = storage_file(bag);
        let whole = zstd::decode_all(fs::File::open(&file).unwrap()).unwrap();
        let mut encoder = zstd::Encoder::new(fs::File::create(&file).unwrap(), 0).unwrap();
        encoder.include_checksum(true).unwrap();
        std::io::Write::write_all(&mut encoder, &whole).unwrap();
        encoder.finish().unwrap();
    }
    written
}

/// A bag of each kind whose storage has checksums, or is one compressed file.
struct Made {
    metadata: Option<String>,
    name: String,
    whole: Vec<u8>,
    written: Vec<BagMessage>,
}

fn bags() -> &'static [Made] {
    static BAGS: OnceLock<Vec<Made>> = OnceLock::new();
    BAGS.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("log.mcap");
        let compressions = [
            None,
            Some(mcap::Compression::Lz4),
            Some(mcap::Compression::Zstd),
        ];
        let chunked = compressions.map(|compression| {
            let written = write_chunks(&file, compression);
            Made {
                metadata: None,
                name: "log.mcap".to_owned(),
                whole: fs::read(&file).unwrap(),
                written,
            }
        });
        let packed = [Storage::Mcap, Storage::Sqlite3].map(|storage| {
            let bag = folder.path().join(format!("{storage:?}"));
            let written = write_packed(&bag, storage, storage == Storage::Sqlite3);
            let file = storage_file(&bag);
            Made {
                metadata: Some(fs::read_to_string(bag.join("metadata.yaml")).unwrap()),
                name: file.file_name().unwrap().to_str().unwrap().to_owned(),
                whole: fs::read(file).unwrap(),
                written,
            }
        });
        chunked.into_iter().chain(packed).collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn what_is_recovered_and_not_marked_was_written(
        kind in 0..5_usize,
        bends in proptest::collection::vec((0.0..1.0_f64, 1..=255_u8), 1..6),
        end in prop_oneof![2 => Just(1.0), 1 => 0.0..1.0_f64],
    ) {
        let Made { metadata, name, whole, written } = &bags()[kind];
        let folder = tempfile::tempdir().unwrap();
        let bag = folder.path().join("bag");
        fs::create_dir(&bag).unwrap();
        if let Some(metadata) = metadata {
            fs::write(bag.join("metadata.yaml"), metadata).unwrap();
        }
        let mut bytes = whole.clone();
        for (at, bits) in bends {
            let place = (bytes.len() as f64 * at) as usize;
            bytes[place] ^= bits;
        }
        bytes.truncate((whole.len() as f64 * end) as usize);
        fs::write(bag.join(name), &bytes).unwrap();
        let out = folder.path().join("out");
        let Ok(found) = recover(&bag, &out) else {
            prop_assert!(!out.exists());
            return Ok(());
        };
        prop_assert!(found.messages <= written.len() as u64);
        if found.messages < written.len() as u64 {
            prop_assert!(found.damages > 0 && found.lost != Some(0), "{found:?}");
        }
        if let (Some(claimed), Some(lost)) = (found.claimed, found.lost) {
            prop_assert_eq!(claimed, found.messages + lost);
        }
        if found.is_nothing() {
            return Ok(());
        }
        let marked = marked(&found);
        let reader = BagReader::open(&out).unwrap();
        for message in reader.messages(&ReadOptions::default()).unwrap() {
            let message = message.unwrap();
            let topic = &reader.topics()[message.topic].name;
            if marked.contains(&(topic.clone(), message.log_time_ns)) {
                continue;
            }
            let was_written = |one: &&BagMessage| {
                let its = ["/a", "/b"][one.topic];
                its == topic && one.log_time_ns == message.log_time_ns && one.data == message.data
            };
            prop_assert!(written.iter().any(|one| was_written(&one)), "{found:?}");
        }
    }
}
