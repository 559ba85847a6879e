//! Cut, damaged and hostile bags of ROS 1.

use proptest::prelude::*;

use super::*;
use crate::{Recovered, recover};

#[test]
fn a_cut_bag_yields_what_precedes_the_cut() {
    let folder = tempfile::tempdir().unwrap();
    for compression in COMPRESSIONS {
        for has_index in [true, false] {
            let whole = bag(compression, 0, has_index);
            for cut in (0..whole.len()).step_by(61) {
                let path = written(folder.path(), "cut.bag", &whole[..cut]);
                let (some, error) = read(&path);
                let all = expected(0, COUNT);
                assert!(some == all[..some.len()], "{compression} {cut}");
                // Without an index a bag may end behind any record.
                let is_silent = error.is_none() && some.len() < all.len();
                assert!(!is_silent || !has_index, "{compression} cut at {cut}");
                assert!(!(13..=2000).contains(&cut) || error.is_some() || !has_index);
            }
        }
    }
}

#[test]
fn hostile_sizes_cost_no_memory() {
    let folder = tempfile::tempdir().unwrap();
    let start = first_record(0, 0, 0);
    let refused = |bytes: &[u8]| {
        let path = written(folder.path(), "x.bag", &[&start, bytes].concat());
        let (messages, error) = read(&path);
        assert!(messages.is_empty());
        error.unwrap().to_string()
    };
    let bomb = compressed("bz2", &vec![0; 64 << 20]);
    assert!(bomb.len() < 1000);
    let claim = |compression: &str, data: &[u8], size: u32| {
        let size = size.to_le_bytes();
        let fields: [(&str, &[u8]); 3] = [
            ("compression", compression.as_bytes()),
            ("op", &[5]),
            ("size", &size),
        ];
        record(&fields, data)
    };
    assert!(refused(&claim("bz2", &bomb, 1000)).contains("1001 bytes that states 1000"));
    assert!(refused(&claim("lz4", b"x", u32::MAX)).contains("limit"));
    assert!(refused(&claim("lz4", b"xxxxxxxxxxx", 5)).contains("decompress"));
    assert!(refused(&claim("none", b"x", 9)).contains("invalid record"));
    assert!(refused(&claim("gzip", b"x", 1)).contains("gzip"));
    assert!(refused(&[0xff; 64]).contains("header of"));
    let long = [&record(&[("op", &[5])], &[])[..12], &[0xff; 4]].concat();
    assert!(refused(&long).contains("ends at byte"));
}

/// A damage: its kind, place and value.
fn damaged(whole: &[u8], kind: u32, at: f64, value: u8) -> Vec<u8> {
    let mut bytes = whole.to_vec();
    let place = (whole.len() as f64 * at) as usize;
    let end = (place + 1 + usize::from(value)).min(whole.len());
    match kind {
        0 => bytes[place] = value,
        1 => bytes[place] ^= 1 << (value % 8),
        2 => bytes[place..end].fill(0),
        3 => bytes[place..end].fill(value),
        _ => drop(bytes.drain(place..end)),
    }
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    #[test]
    fn damaged_bags_never_panic_nor_lose_in_silence(
        compression in prop::sample::select(COMPRESSIONS.to_vec()),
        has_index in any::<bool>(),
        kind in 0..5_u32,
        at in 0.0..1.0_f64,
        value in any::<u8>(),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let whole = bag(compression, 0, has_index);
        let bytes = damaged(&whole, kind, at, value);
        let path = written(folder.path(), "x.bag", &bytes);
        let (some, error) = read(&path);
        prop_assert!(error.is_some() || some.len() == COUNT as usize, "{} silently", some.len());
        let out = folder.path().join("out");
        if let Ok(recovered) = recover(&path, &out) {
            let Recovered { messages, damages, lost, .. } = &recovered;
            prop_assert!(*damages > 0 || *lost == Some(0) && *messages == u64::from(COUNT));
            // A damage of at most 256 bytes is in few chunks, unless it is in a connection.
            let in_connection = !(0.15..=0.8).contains(&at);
            prop_assert!(*messages >= u64::from(COUNT) - 30 || in_connection,
                "{messages} of {COUNT}");
        }
    }
}
