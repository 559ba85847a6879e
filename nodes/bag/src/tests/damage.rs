//! Cut and bent files: what precedes the damage is read, and nothing panics.

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

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn cut_or_bent_files_never_panic(
        kind in 0..ALL.len(),
        at in 0.0..1.0_f64,
        value in any::<u8>(),
        bend in any::<bool>(),
    ) {
        let (storage, packing) = ALL[kind];
        let folder = tempfile::tempdir().unwrap();
        let bag = folder.path().join("bag");
        let written = write(&bag, storage, packing, 60, 0);
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
