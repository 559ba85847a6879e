//! CDR encoding of messages, on the wire and in bags, with its encapsulation header of four bytes.

use byteorder::{BigEndian, LittleEndian};
use serde::{Serialize, de::DeserializeOwned};
use thiserror::Error;

/// Encapsulation header of plain CDR, little endian, no options.
const LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];

/// Largest padding after the last field, to a multiple of four.
const MAX_PADDING: usize = 3;

/// Error of decoding or encoding a message.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CdrError {
    /// Missing header.
    #[error("CDR message of {length} bytes; its header alone has 4")]
    NoHeader {
        /// Bytes there are.
        length: usize,
    },
    /// Neither little nor big endian plain CDR.
    #[error("CDR header {:02x}{:02x} is not plain CDR (0000 or 0001); have the sender use XCDR1", .kind[0], .kind[1])]
    Encapsulation {
        /// First two bytes of the header.
        kind: [u8; 2],
    },
    /// Data that do not match the type: a length past the end, an invalid bool, or invalid UTF-8.
    #[error("{length} bytes are not a {type_name}: {source}")]
    Decode {
        /// Rust name of the type.
        type_name: &'static str,
        /// Bytes there are, header included.
        length: usize,
        /// Cause.
        source: cdr_encoding::Error,
    },
    /// Data longer than the type.
    #[error(
        "{left} of {length} bytes are left after {type_name}; the sender has another definition of the type: \
         use the same version of its package"
    )]
    Trailing {
        /// Rust name of the type.
        type_name: &'static str,
        /// Bytes after the last field.
        left: usize,
        /// Bytes there are, header included.
        length: usize,
    },
    /// The value cannot be encoded.
    #[error("cannot write {type_name} as CDR: {source}")]
    Encode {
        /// Rust name of the type.
        type_name: &'static str,
        /// Cause.
        source: cdr_encoding::Error,
    },
    /// Lengths in CDR have 32 bits.
    #[error("{type_name} takes {length} bytes, more than the 4294967295 of CDR; send it in parts")]
    TooLong {
        /// Rust name of the type.
        type_name: &'static str,
        /// Bytes it takes.
        length: usize,
    },
}

/// Encodes a message, little endian, header included. Fails beyond 4 GiB.
pub fn to_vec<T: Serialize>(message: &T) -> Result<Vec<u8>, CdrError> {
    let type_name = std::any::type_name::<T>();
    let mut bytes = Vec::with_capacity(LITTLE_ENDIAN.len() + 2 * size_of::<T>());
    bytes.extend_from_slice(&LITTLE_ENDIAN);
    cdr_encoding::to_writer::<_, LittleEndian, _>(&mut bytes, message)
        .map_err(|source| CdrError::Encode { type_name, source })?;
    match u32::try_from(bytes.len()) {
        Ok(_) => Ok(bytes),
        Err(_) => Err(CdrError::TooLong {
            type_name,
            length: bytes.len(),
        }),
    }
}

/// Decodes a message of either byte order. All bytes must belong to it except up to 3 of padding.
///
/// Safe for untrusted bytes: sequences grow with the elements that are present, so memory is
/// bounded by a small multiple of the length of `bytes`, for any stated lengths.
pub fn from_slice<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, CdrError> {
    let (type_name, length) = (std::any::type_name::<T>(), bytes.len());
    let Some((&[high, low, _, _], body)) = bytes.split_first_chunk() else {
        return Err(CdrError::NoHeader { length });
    };
    let decoded = match (high, low) {
        (0, 0) => cdr_encoding::from_bytes::<T, BigEndian>(body),
        (0, 1) => cdr_encoding::from_bytes::<T, LittleEndian>(body),
        _ => return Err(CdrError::Encapsulation { kind: [high, low] }),
    };
    let (message, used) = decoded.map_err(|source| CdrError::Decode {
        type_name,
        length,
        source,
    })?;
    match body.len().saturating_sub(used) {
        0..=MAX_PADDING => Ok(message),
        left => Err(CdrError::Trailing {
            type_name,
            left,
            length,
        }),
    }
}

#[cfg(test)]
mod tests {
    use serde_bytes::ByteBuf;

    use super::*;
    use crate::builtin_interfaces::Time;
    use crate::sensor_msgs::PointCloud2;
    use crate::std_msgs::Header;

    fn header() -> Header {
        Header {
            stamp: Time { sec: 1, nanosec: 2 },
            frame_id: "map".to_owned(),
        }
    }

    /// Header of this crate's [`header`] as a big-endian sender writes it.
    const BIG: &[u8] = b"\0\0\0\0\0\0\0\x01\0\0\0\x02\0\0\0\x04map\0";

    #[test]
    fn both_byte_orders() {
        let little = to_vec(&header()).unwrap();
        assert_eq!(little, b"\0\x01\0\0\x01\0\0\0\x02\0\0\0\x04\0\0\0map\0");
        assert_eq!(from_slice::<Header>(&little).unwrap(), header());
        assert_eq!(from_slice::<Header>(BIG).unwrap(), header());
    }

    #[test]
    fn padding_is_allowed_and_more_is_not() {
        let mut bytes = to_vec(&header()).unwrap();
        for _ in 0..MAX_PADDING {
            bytes.push(0);
            assert_eq!(from_slice::<Header>(&bytes).unwrap(), header());
        }
        bytes.push(0);
        let error = from_slice::<Header>(&bytes).unwrap_err();
        assert!(
            matches!(
                error,
                CdrError::Trailing {
                    left: 4,
                    length: 24,
                    ..
                }
            ),
            "{error}"
        );
    }

    #[test]
    fn headers_that_are_none() {
        for length in 0..4 {
            let error = from_slice::<Header>(&BIG[..length]).unwrap_err();
            assert!(
                matches!(error, CdrError::NoHeader { length: l } if l == length),
                "{error}"
            );
        }
        for kind in [[0, 2], [0, 3], [0, 6], [0, 7], [1, 1], [0xff, 0xff]] {
            let mut bytes = to_vec(&header()).unwrap();
            bytes[..2].copy_from_slice(&kind);
            let error = from_slice::<Header>(&bytes).unwrap_err();
            assert!(
                matches!(error, CdrError::Encapsulation { kind: k } if k == kind),
                "{error}"
            );
        }
    }

    #[test]
    fn every_truncation_fails() {
        for length in 4..BIG.len() {
            let error = from_slice::<Header>(&BIG[..length]).unwrap_err();
            assert!(
                matches!(error, CdrError::Decode { .. }),
                "{length}: {error}"
            );
        }
    }

    #[test]
    fn alignment_starts_after_the_header() {
        // One byte, then a number at a multiple of 8 from the end of the header.
        let bytes = to_vec(&(7_u8, 1.0_f64)).unwrap();
        assert_eq!(bytes.len(), 4 + 8 + 8);
        assert_eq!(from_slice::<(u8, f64)>(&bytes).unwrap(), (7, 1.0));
    }

    #[test]
    fn point_data_is_one_block() {
        let data: Vec<u8> = (0..=255).collect();
        let cloud = PointCloud2 {
            data: ByteBuf::from(data.clone()),
            ..Default::default()
        };
        let bytes = to_vec(&cloud).unwrap();
        assert!(bytes.windows(data.len()).any(|window| window == data));
        assert_eq!(from_slice::<PointCloud2>(&bytes).unwrap(), cloud);
    }
}
