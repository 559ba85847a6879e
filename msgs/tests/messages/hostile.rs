//! Bytes from anyone: no panic, and no more memory than the bytes warrant.

#![allow(clippy::unwrap_used)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use crate::shape::filled;
use lattice_msgs::{MessageVisitor, RosMessage, cdr, visit_messages};
use proptest::prelude::*;

/// Counts the memory that each thread holds.
struct Meter;

thread_local! {
    static HELD: Cell<usize> = const { Cell::new(0) };
    static PEAK: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: every call is handed on to the system's allocator as it is.
unsafe impl GlobalAlloc for Meter {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let held = HELD.get().saturating_add(layout.size());
        HELD.set(held);
        PEAK.set(PEAK.get().max(held));
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        HELD.set(HELD.get().saturating_sub(layout.size()));
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static METER: Meter = Meter;

/// Most bytes held at a time while `work` runs, above those held before.
fn peak(work: impl FnOnce()) -> usize {
    let before = HELD.get();
    PEAK.set(before);
    work();
    PEAK.get() - before
}

/// Decodes the bytes as every type there is; what succeeds must come back from its own bytes.
struct DecodeAll<'a>(&'a [u8]);

impl MessageVisitor for DecodeAll<'_> {
    fn visit<M: RosMessage>(&mut self) {
        check_one::<M>(self.0);
    }
}

fn check_one<M: RosMessage>(bytes: &[u8]) {
    let mut decoded = None;
    let held = peak(|| decoded = cdr::from_slice::<M>(bytes).ok());
    // A string of length 0 takes 4 bytes on the wire and 24 here, twice that while a Vec grows;
    // a Vec starts with room for 4 elements, and the largest element, Marker, has some 600 bytes.
    let allowed = 32 * bytes.len() + 8192;
    assert!(
        held <= allowed,
        "{}: {held} bytes held for {} bytes",
        M::TYPE,
        bytes.len()
    );
    if let Some(message) = decoded {
        let again = cdr::to_vec(&message).unwrap();
        let back = cdr::from_slice::<M>(&again).unwrap();
        // By bytes: NaN is not equal to itself.
        assert_eq!(cdr::to_vec(&back).unwrap(), again, "{}", M::TYPE);
    }
}

/// Damages valid bytes of every type.
struct Mutate {
    at: prop::sample::Index,
    value: u32,
    cut: prop::sample::Index,
    big_endian: bool,
}

impl MessageVisitor for Mutate {
    fn visit<M: RosMessage>(&mut self) {
        let valid = cdr::to_vec(&filled::<M>(3).0).unwrap();
        let mut bytes = valid.clone();
        bytes[1] = u8::from(!self.big_endian);
        let words = bytes.len().div_ceil(4) - 1;
        if words > 0 {
            let word = 4 + 4 * self.at.index(words);
            for (byte, new) in bytes[word..].iter_mut().zip(self.value.to_le_bytes()) {
                *byte = new;
            }
        }
        check_one::<M>(&bytes);
        check_one::<M>(&valid[..self.cut.index(valid.len())]);
    }
}

/// Lengths that would hurt, small ones that move fields about, and any other.
fn lengths() -> impl Strategy<Value = u32> {
    prop_oneof![
        Just(u32::MAX),
        Just(i32::MAX as u32),
        Just(1 << 31),
        Just(1 << 28),
        0..64_u32,
        any::<u32>()
    ]
}

proptest! {
    #[test]
    fn random_bytes(
        mut bytes in prop::collection::vec(any::<u8>(), 0..600),
        header in prop_oneof![Just(Some(0)), Just(Some(1)), Just(None)],
    ) {
        if let Some(order) = header && bytes.len() >= 4 {
            bytes[..4].copy_from_slice(&[0, order, 0, 0]);
        }
        visit_messages(&mut DecodeAll(&bytes));
    }

    #[test]
    fn mostly_empty_bytes(
        length in 4..4000_usize,
        set in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..8),
    ) {
        let mut bytes = vec![0; length];
        for (at, value) in set {
            bytes[at.index(length)] = value;
        }
        bytes[..4].copy_from_slice(&[0, 1, 0, 0]);
        visit_messages(&mut DecodeAll(&bytes));
    }

    #[test]
    fn damaged_messages(
        at in any::<prop::sample::Index>(),
        value in lengths(),
        cut in any::<prop::sample::Index>(),
        big_endian in any::<bool>(),
    ) {
        visit_messages(&mut Mutate { at, value, cut, big_endian });
    }
}

struct RoundTrip(usize);

impl MessageVisitor for RoundTrip {
    fn visit<M: RosMessage>(&mut self) {
        for length in [0, 1, 2, 17] {
            let message = filled::<M>(length).0;
            let bytes = cdr::to_vec(&message).unwrap();
            assert_eq!(
                cdr::from_slice::<M>(&bytes).unwrap(),
                message,
                "{}",
                M::TYPE
            );
        }
        let bytes = cdr::to_vec(&M::default()).unwrap();
        assert_eq!(
            cdr::from_slice::<M>(&bytes).unwrap(),
            M::default(),
            "{}",
            M::TYPE
        );
        self.0 += 1;
    }
}

#[test]
fn every_message_comes_back_from_its_bytes() {
    let mut round_trip = RoundTrip(0);
    visit_messages(&mut round_trip);
    assert!(round_trip.0 > 60, "{} messages", round_trip.0);
}

#[test]
fn the_meter_measures() {
    let held = peak(|| drop(std::hint::black_box(vec![0_u8; 100_000])));
    assert!((100_000..101_000).contains(&held), "{held}");
}

#[test]
fn a_long_declared_length_fails_without_its_memory() {
    use lattice_msgs::cdr::CdrError;
    use lattice_msgs::visualization_msgs::Marker;
    use serde_bytes::ByteBuf;

    fn check<T: serde::de::DeserializeOwned>() {
        for length in [u32::MAX, 1 << 31, 1 << 24, 100] {
            let mut bytes = vec![0, 1, 0, 0];
            bytes.extend_from_slice(&length.to_le_bytes());
            bytes.extend_from_slice(&[0; 64]);
            let held = peak(|| {
                let result = cdr::from_slice::<T>(&bytes);
                assert!(matches!(result, Err(CdrError::Decode { .. })), "{length}");
            });
            assert!(held < 8192, "{length}: {held}");
        }
    }
    check::<String>();
    check::<ByteBuf>();
    check::<Vec<f64>>();
    check::<Vec<String>>();
    check::<Vec<Marker>>();
}
