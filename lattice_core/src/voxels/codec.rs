//! Sorted keys as bytes: LEB128 varints of the differences, the first key absolute.
//!
//! A varint has seven bits per byte, lowest first; the top bit marks a continuation. Only the shortest form is
//! accepted, so that a list of keys has one encoding.

use thiserror::Error;

use crate::lattice::MortonKey;

/// Error in encoded keys; positions are bytes from the start of the keys.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum CodecError {
    /// Bytes that end within a varint.
    #[error("the bytes end at byte {position} within a number: the message or file is cut short")]
    Truncated { position: usize },
    /// Varint longer than necessary or beyond 64 bits.
    #[error("the number that ends at byte {position} is not a shortest 64-bit varint")]
    Varint { position: usize },
    /// Key that repeats or reaches 2^63.
    #[error("key {index}, before byte {position}, does not ascend or is not below 2^63")]
    Key { index: usize, position: usize },
    /// Count that does not fit 32 bits.
    #[error("count {value}, before byte {position}, is above 4294967295")]
    Count { value: u64, position: usize },
    /// More keys than allowed.
    #[error("more than {max} keys")]
    TooMany { max: usize },
}

/// Encodes keys, which must ascend strictly; others do not decode.
pub fn encode_keys(sorted: &[MortonKey]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(sorted.len().saturating_mul(2));
    let mut before = 0;
    for key in sorted {
        push_varint(&mut bytes, key.raw().wrapping_sub(before));
        before = key.raw();
    }
    bytes
}

/// Encodes counts as LEB128, one byte for those below 128.
pub fn encode_counts(counts: &[u32]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(counts.len());
    for count in counts {
        push_varint(&mut bytes, u64::from(*count));
    }
    bytes
}

/// Splits bytes after the first `len` LEB128 numbers, which are not validated.
pub fn split_numbers(bytes: &[u8], len: usize) -> Result<(&[u8], &[u8]), CodecError> {
    let ends = bytes.iter().enumerate().filter(|(_, byte)| **byte < 0x80);
    let end = match len.checked_sub(1) {
        Some(last) => ends.map(|(at, _)| at + 1).nth(last),
        None => Some(0),
    };
    let position = bytes.len();
    end.and_then(|end| bytes.split_at_checked(end))
        .ok_or(CodecError::Truncated { position })
}

/// Decodes the first `len` numbers as counts; returns them and the bytes after them. Allocates in proportion to the
/// input.
pub fn decode_counts(bytes: &[u8], len: usize) -> Result<(Vec<u32>, &[u8]), CodecError> {
    let (numbers, rest) = split_numbers(bytes, len)?;
    let mut values = Varints::new(numbers);
    let mut counts = Vec::with_capacity(len.min(numbers.len()));
    while let Some(value) = values.next_value()? {
        let position = values.position();
        counts.push(u32::try_from(value).map_err(|_| CodecError::Count { value, position })?);
    }
    Ok((counts, rest))
}

/// Decodes at most `max` strictly ascending keys; allocates in proportion to the input.
pub fn decode_keys(bytes: &[u8], max: usize) -> Result<Vec<MortonKey>, CodecError> {
    let mut keys = Vec::with_capacity(bytes.len().min(max));
    let mut steps = Varints::new(bytes);
    let mut before: Option<MortonKey> = None;
    loop {
        if let Some(last) = before
            && max - keys.len() >= 8
            && let Some(next) = steps.next_eight(last)
        {
            keys.extend_from_slice(&next);
            before = next.last().copied();
            continue;
        }
        let Some(step) = steps.next_value()? else {
            return Ok(keys);
        };
        if keys.len() == max {
            return Err(CodecError::TooMany { max });
        }
        let key = next_key(before, step).ok_or(CodecError::Key {
            index: keys.len(),
            position: steps.position(),
        })?;
        before = Some(key);
        keys.push(key);
    }
}

/// Key `step` after `before`.
#[inline]
fn next_key(before: Option<MortonKey>, step: u64) -> Option<MortonKey> {
    match before {
        Some(_) if step == 0 => None,
        Some(before) => before.raw().checked_add(step).and_then(MortonKey::from_raw),
        None => MortonKey::from_raw(step),
    }
}

pub(super) fn push_varint(bytes: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
}

pub(super) struct Varints<'a> {
    bytes: &'a [u8],
    position: usize,
}

const TOP_BITS: u64 = 0x8080_8080_8080_8080;

impl<'a> Varints<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Varints<'a> {
        Varints { bytes, position: 0 }
    }

    pub(super) fn position(&self) -> usize {
        self.position
    }

    /// Next number; `None` at the end.
    #[inline]
    pub(super) fn next_value(&mut self) -> Result<Option<u64>, CodecError> {
        match self.bytes.get(self.position) {
            Some(&byte) if byte < 0x80 => {
                self.position += 1;
                Ok(Some(u64::from(byte)))
            }
            Some(_) => self.next_long().map(Some),
            None => Ok(None),
        }
    }

    fn next_long(&mut self) -> Result<u64, CodecError> {
        let (mut value, mut shift) = (0, 0);
        for &byte in self.bytes.iter().skip(self.position) {
            if (shift == 63 && byte > 1) || (shift > 0 && byte == 0) {
                let position = self.position;
                return Err(CodecError::Varint { position });
            }
            self.position += 1;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Ok(value);
            }
            shift += 7;
        }
        Err(CodecError::Truncated {
            position: self.position,
        })
    }

    /// The eight keys after `last` if each step is one nonzero byte and the keys stay far below 2^63.
    #[inline]
    fn next_eight(&mut self, last: MortonKey) -> Option<[MortonKey; 8]> {
        let rest = self.bytes.get(self.position..)?;
        let (steps, _) = rest.split_first_chunk::<8>()?;
        let packed = u64::from_le_bytes(*steps);
        // Without top bits, subtracting 1 from each byte sets one exactly if there is a zero byte.
        if (packed | packed.wrapping_sub(TOP_BITS >> 7)) & TOP_BITS != 0 {
            return None;
        }
        MortonKey::from_raw(last.raw() + 8 * 0x7f)?;
        let mut raw = last.raw();
        self.position += 8;
        Some(steps.map(|step| {
            raw += u64::from(step);
            MortonKey::from_raw(raw).unwrap_or(last)
        }))
    }
}

/// Zigzag: signed as unsigned, small magnitudes first: 0, -1, 1, -2, ...
pub(super) fn zigzag(value: i64) -> u64 {
    (value.wrapping_shl(1) ^ (value >> 63)) as u64
}

/// Inverse of `zigzag`.
pub(super) fn unzigzag(value: u64) -> i64 {
    (value >> 1) as i64 ^ -((value & 1) as i64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn key(raw: u64) -> MortonKey {
        MortonKey::from_raw(raw).unwrap()
    }

    #[test]
    fn the_bytes_are_those_of_the_format() {
        let keys = [key(300), key(301), key(301 + 128)];
        assert_eq!(encode_keys(&keys), [0xac, 0x02, 0x01, 0x80, 0x01]);
        assert_eq!(decode_keys(&[], 0), Ok(vec![]));
        assert_eq!(decode_keys(&[0], 1), Ok(vec![key(0)]));
    }

    #[test]
    fn faults_are_named_with_their_place() {
        let decode = |bytes: &[u8]| decode_keys(bytes, 4).unwrap_err();
        assert_eq!(decode(&[1, 0x80]), CodecError::Truncated { position: 2 });
        assert_eq!(decode(&[1, 0x80, 0x00]), CodecError::Varint { position: 2 });
        assert_eq!(decode(&[0xff; 12]), CodecError::Varint { position: 9 });
        assert_eq!(
            decode(&[1, 1, 0]),
            CodecError::Key {
                index: 2,
                position: 3
            }
        );
        assert_eq!(decode(&[1; 5]), CodecError::TooMany { max: 4 });
        let mut far = encode_keys(&[key((1 << 63) - 1)]);
        far.push(1);
        assert_eq!(
            decode(&far),
            CodecError::Key {
                index: 1,
                position: 10
            }
        );
    }

    #[test]
    fn keys_out_of_order_do_not_decode() {
        assert!(decode_keys(&encode_keys(&[key(5), key(4)]), 9).is_err());
        assert!(decode_keys(&encode_keys(&[key(5), key(5)]), 9).is_err());
    }

    proptest! {
        #[test]
        fn round_trip(mut raws in prop::collection::btree_set(0_u64..1 << 63, 0..100)) {
            raws.insert((1 << 63) - 1);
            let keys: Vec<MortonKey> = raws.into_iter().map(key).collect();
            prop_assert_eq!(decode_keys(&encode_keys(&keys), keys.len()), Ok(keys));
        }

        #[test]
        fn runs_of_short_steps_round_trip(
            first in 1_u64..1 << 62,
            steps in prop::collection::vec(prop_oneof![9 => 1_u64..128, 1 => 1_u64..1 << 40], 0..200),
            zero in any::<prop::sample::Index>(),
        ) {
            let mut raw = first;
            let mut keys = vec![key(first)];
            for step in &steps {
                raw += step;
                keys.push(key(raw));
            }
            let mut bytes = encode_keys(&keys);
            prop_assert_eq!(decode_keys(&bytes, keys.len()), Ok(keys.clone()));
            prop_assert_eq!(
                decode_keys(&bytes, keys.len() - 1),
                Err(CodecError::TooMany { max: keys.len() - 1 })
            );
            // A step of zero is found wherever it is, and at the end of the range too.
            let start = encode_keys(&keys[..1]).len();
            let at = start + zero.index(bytes.len() - start + 1);
            let before = decode_keys(&bytes[..at], keys.len());
            bytes.insert(at, 0);
            prop_assert!(before.is_err() || decode_keys(&bytes, keys.len() + 1).is_err());
        }

        #[test]
        fn no_run_passes_the_last_key(below in 0_u64..2000) {
            let mut bytes = encode_keys(&[key((1 << 63) - 1 - below)]);
            let start = bytes.len();
            bytes.resize(start + 24, 0x7f);
            let fits = below / 0x7f >= 24;
            let decoded = decode_keys(&bytes, 25);
            prop_assert_eq!(decoded.is_ok(), fits);
            if let Err(CodecError::Key { index, position }) = decoded {
                prop_assert_eq!((index as u64, position - start), (below / 0x7f + 1, index));
            }
        }

        #[test]
        fn any_bytes_decode_to_what_encodes_to_them(bytes in prop::collection::vec(any::<u8>(), 0..60)) {
            if let Ok(keys) = decode_keys(&bytes, 60) {
                prop_assert_eq!(encode_keys(&keys), bytes);
            }
        }

        #[test]
        fn zigzag_round_trip(value in any::<i64>()) {
            prop_assert_eq!(unzigzag(zigzag(value)), value);
            prop_assert_eq!(zigzag(value) >> 1, value.unsigned_abs() - u64::from(value < 0));
        }
    }
}
