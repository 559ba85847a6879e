//! LZF decompression; the format has no header and no checksum.
//!
//! A control byte c below 32 is followed by c + 1 literal bytes. Otherwise its upper
//! three bits, plus the next byte if they are 7, plus 2, are the length of a copy. Its lower five bits and
//! the last byte are the distance of the copy's start before the previous byte.

/// Error in compressed data and its position.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Corrupt {
    /// Start of the invalid item.
    pub(super) byte: usize,
    /// Fault of the compressed data.
    pub(super) reason: String,
}

/// Decompresses data of `length` bytes; memory is bounded by about 90 times that of `packed`.
pub(super) fn unpack(packed: &[u8], length: usize) -> Result<Vec<u8>, Corrupt> {
    let mut data: Vec<u8> = Vec::with_capacity(length.min(packed.len().saturating_mul(4)));
    let mut rest = packed;
    while !rest.is_empty() {
        let byte = packed.len() - rest.len();
        let corrupt = |reason: String| Corrupt { byte, reason };
        let ended = || corrupt("the compressed data ends within a piece".to_owned());
        let (control, after) = rest.split_first().ok_or_else(ended)?;
        let size = if *control < 32 {
            let size = usize::from(*control) + 1;
            let (literal, after) = after.split_at_checked(size).ok_or_else(ended)?;
            data.extend_from_slice(literal);
            rest = after;
            size
        } else {
            let (extra, after) = match (control >> 5, after) {
                (7, [extra, after @ ..]) => (*extra, after),
                (7, []) => return Err(ended()),
                _ => (0, after),
            };
            let (low, after) = after.split_first().ok_or_else(ended)?;
            let size = usize::from(control >> 5) + usize::from(extra) + 2;
            let back = (usize::from(control & 31) << 8 | usize::from(*low)) + 1;
            let start = data.len().checked_sub(back).ok_or_else(|| {
                corrupt(format!("a copy from {back} bytes back, of {}", data.len()))
            })?;
            // Source and target may overlap: the copy then repeats its own output.
            for at in start..start + size {
                data.extend(data.get(at).copied());
            }
            rest = after;
            size
        };
        if data.len() > length {
            let surplus = data.len() - length;
            let reason =
                format!("a piece of {size} bytes is {surplus} beyond the {length} promised");
            return Err(corrupt(reason));
        }
    }
    if data.len() < length {
        let reason = format!("the compressed data gives {} bytes of {length}", data.len());
        let byte = packed.len();
        return Err(Corrupt { byte, reason });
    }
    Ok(data)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn literals_copies_and_long_copies() {
        assert_eq!(unpack(&[2, b'a', b'b', b'c'], 3).unwrap(), b"abc");
        // Three bytes, from three back: a copy without overlap.
        assert_eq!(
            unpack(&[2, b'a', b'b', b'c', 1 << 5, 2], 6).unwrap(),
            b"abcabc"
        );
        // 7 + 255 + 2 bytes, from one back.
        assert_eq!(
            unpack(&[0, b'z', 7 << 5, 255, 0], 265).unwrap(),
            vec![b'z'; 265]
        );
        assert_eq!(unpack(&[], 0).unwrap(), b"");
    }

    #[test]
    fn distances_have_13_bits() {
        let bytes: Vec<u8> = (0..8192_u32).map(|i| (i % 251) as u8).collect();
        let mut packed: Vec<u8> = Vec::new();
        for literal in bytes.chunks(32) {
            packed.push(31);
            packed.extend(literal);
        }
        packed.extend([1 << 5 | 31, 255]);
        let data = unpack(&packed, 8195).unwrap();
        assert_eq!(data[8192..], bytes[..3]);
    }

    #[test]
    fn faults_are_told_with_their_place() {
        let place = |packed: &[u8], length| unpack(packed, length).unwrap_err().byte;
        assert_eq!(place(&[0, 1, 5, 2], 7), 2);
        assert_eq!(place(&[0, 1, 7 << 5], 7), 2);
        assert_eq!(place(&[0, 1, 7 << 5, 9], 7), 2);
        assert_eq!(place(&[0, 1, 1 << 5], 7), 2);
        assert_eq!(place(&[0, 1, 1 << 5, 1], 7), 2);
        assert_eq!(place(&[0, 1, 0, 2], 1), 2);
        assert_eq!(place(&[0, 1, 0, 2], 3), 4);
    }
}
