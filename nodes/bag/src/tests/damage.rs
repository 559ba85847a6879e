//! Cut and bent files: what precedes the damage is read, and nothing panics.

use std::sync::OnceLock;

use proptest::prelude::*;

use super::{foreign::write_foreign, *};

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
    let new = || mcap::WriteOptions::new().compression(None);
    for options in [
        new(),
        new().compression(Some(mcap::Compression::Zstd)),
        new().use_chunks(false),
    ] {
        let (file, written) = write_foreign(folder.path(), options, "cdr");
        let whole = fs::read(file).unwrap();
        let file = folder.path().join("cut.mcap");
        for cut in 0..=whole.len() {
            check_cut(&file, &whole, cut, &written);
        }
    }
}

/// A bag of one storage file.
struct Made {
    name: String,
    metadata: String,
    whole: Vec<u8>,
    written: Vec<BagMessage>,
}

/// A bag of each storage and compression.
fn bags() -> &'static [Made] {
    static BAGS: OnceLock<Vec<Made>> = OnceLock::new();
    BAGS.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let bag = folder.path().join("bag");
        let made = ALL.map(|(storage, packing)| {
            let written = write(&bag, storage, packing, 60, 0);
            let file = storage_file(&bag);
            Made {
                name: file.file_name().unwrap().to_str().unwrap().to_owned(),
                metadata: fs::read_to_string(bag.join("metadata.yaml")).unwrap(),
                whole: fs::read(file).unwrap(),
                written,
            }
        });
        made.into()
    })
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
        let Made { name, metadata, whole, written } = &bags()[kind];
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("metadata.yaml"), metadata).unwrap();
        let file = folder.path().join(name);
        let place = (whole.len() as f64 * at) as usize;
        if bend {
            let mut bent = whole.clone();
            bent[place] = value;
            fs::write(&file, &bent).unwrap();
            let _ = read_some(folder.path());
            let (some, error) = read_some(&file);
            // Pages of SQLite have no checksum: a bent one may give a row twice.
            prop_assert!(some.len() <= 2 * written.len() || error.is_some());
        } else {
            check_cut(&file, whole, place, written);
        }
    }
}

#[test]
fn a_folder_whose_recorder_was_killed_ends_where_its_file_is_cut() {
    for (name, metadata, whole, written) in bags()
        .iter()
        .map(|made| (&made.name, &made.metadata, &made.whole, &made.written))
        .filter(|(name, ..)| name.ends_with(".mcap"))
    {
        let folder = tempfile::tempdir().unwrap();
        let (file, notes) = (
            folder.path().join(name),
            folder.path().join("metadata.yaml"),
        );
        // The last record of the data.
        let cut = whole.windows(7).position(|w| w == b"rosbag2").unwrap();
        fs::write(&file, &whole[..cut]).unwrap();
        let (some, error) = read_some(folder.path());
        assert!(error.is_none(), "{name}: {error:?}");
        assert!(!some.is_empty() && some == written[..some.len()], "{name}");
        // The metadata of a recorder that ended, or a file alone: something is missing.
        fs::write(&notes, metadata).unwrap();
        for place in [folder.path(), &file] {
            let (again, error) = read_some(place);
            assert_eq!(again, some, "{name}");
            assert!(
                matches!(error, Some(BagError::Truncated { .. })),
                "{name}: {error:?}"
            );
        }
    }
}

#[test]
fn a_bent_chunk_is_found_by_its_crc_and_placed() {
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
    let error = error.unwrap().to_string();
    assert!(
        error.contains("CRC") && error.contains("chunk at byte"),
        "{error}"
    );
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

#[test]
fn a_bent_summary_is_passed_over() {
    let folder = tempfile::tempdir().unwrap();
    let (path, written) = write_foreign(folder.path(), mcap::WriteOptions::new(), "cdr");
    let whole = fs::read(&path).unwrap();
    // Opcode and length of the footer take 9 bytes, the footer and the magic 37.
    let footer = whole.len() - 37;
    let start = u64::from_le_bytes(whole[footer + 9..footer + 17].try_into().unwrap());
    for at in usize::try_from(start).unwrap()..footer {
        let mut bent = whole.clone();
        bent[at] ^= 0x40;
        fs::write(&path, &bent).unwrap();
        assert_eq!(read(&path).unwrap(), written, "byte {at}");
    }
}

/// Places of all byte strings like `needle`.
fn places(bytes: &[u8], needle: &[u8]) -> Vec<usize> {
    let windows = bytes.windows(needle.len()).enumerate();
    windows
        .filter(|(_, w)| *w == needle)
        .map(|(at, _)| at)
        .collect()
}

#[test]
fn a_record_that_reaches_beyond_its_chunk_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let options = mcap::WriteOptions::new()
        .compression(None)
        .calculate_chunk_crcs(false);
    let (path, written) = write_foreign(folder.path(), options, "cdr");
    let bytes = fs::read(&path).unwrap();
    // 94 bytes of data behind a header of 22, in a chunk that holds two or three of them.
    let message = [&[5][..], &116_u64.to_le_bytes()].concat();
    for at in places(&bytes, &message) {
        for len in [117_u64, 400, 1 << 29, 1 << 40, u64::MAX - 8, u64::MAX] {
            let mut bent = bytes.clone();
            bent[at + 1..at + 9].copy_from_slice(&len.to_le_bytes());
            fs::write(&path, &bent).unwrap();
            let (some, error) = read_some(&path);
            assert_eq!(some, written[..some.len()], "{len} at {at}");
            let error = error.unwrap_or_else(|| panic!("{len} at {at}")).to_string();
            assert!(error.contains("chunk at byte"), "{error}");
        }
    }
}

#[test]
fn a_record_does_not_reach_into_the_padding_of_its_chunk() {
    let folder = tempfile::tempdir().unwrap();
    let options = mcap::WriteOptions::new()
        .compression(None)
        .calculate_chunk_crcs(false)
        .emit_summary_records(false);
    let (path, _) = write_foreign(folder.path(), options, "cdr");
    let mut bytes = fs::read(&path).unwrap();
    let word = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
    // Magic (8), header record, then the chunk: opcode and length (9), times and sizes (32).
    let size_at = 8 + 9 + usize::try_from(word(9)).unwrap() + 9 + 32;
    let smaller = word(size_at) - 20;
    bytes[size_at..size_at + 8].copy_from_slice(&smaller.to_le_bytes());
    fs::write(&path, &bytes).unwrap();
    let (some, error) = read_some(&path);
    assert!(some.is_empty() && error.is_some());
}

#[test]
fn a_claimed_length_takes_no_more_memory_than_the_chunk_can_hold() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lying.mcap");
    let record = |opcode: u8, len: u64| [&[opcode][..], &len.to_le_bytes()].concat();
    let claimed = 1_u64 << 29;
    let content = zstd::encode_all(&record(5, claimed)[..], 0).unwrap();
    // Times, size of the content, no CRC, compression, content.
    let mut chunk = [0; 16].to_vec();
    chunk.extend((claimed + 9).to_le_bytes());
    chunk.extend([0, 0, 0, 0, 4, 0, 0, 0]);
    chunk.extend(b"zstd");
    chunk.extend((content.len() as u64).to_le_bytes());
    chunk.extend(content);
    let mut bytes = [mcap::MAGIC, &record(1, 8), &[0; 8]].concat();
    bytes.extend(record(6, chunk.len() as u64));
    bytes.extend(chunk);
    fs::write(&path, bytes).unwrap();
    let (some, error) = read_some(&path);
    assert!(some.is_empty());
    let Some(BagError::TooLarge {
        size_bytes,
        limit_bytes,
        ..
    }) = error
    else {
        panic!("{error:?}")
    };
    assert_eq!(size_bytes, claimed);
    assert!(limit_bytes < 4 << 20, "{limit_bytes}");
}
