//! Messages as bytes on the wire and in bags: CDR with its encapsulation header of four bytes.

use byteorder::{BigEndian, LittleEndian};
use serde::{Serialize, de::DeserializeOwned};
use thiserror::Error;

/// Encapsulation header of plain CDR, little endian, no options.
const LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];

/// Padding that a sender may leave after the last field, to a multiple of four.
const MAX_PADDING: usize = 3;

/// Why bytes are no message, or a message has no bytes.
#[derive(Debug, Error)]
pub enum CdrError {
    /// Not even a header.
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
    /// The bytes do not fit the type: a length past the end, a bad bool, text that is not UTF-8.
    #[error("{length} bytes are no {type_name}: {source}")]
    Decode {
        /// Rust name of the type.
        type_name: &'static str,
        /// Bytes there are, header included.
        length: usize,
        /// What went wrong.
        source: cdr_encoding::Error,
    },
    /// The type ends before the bytes do.
    #[error(
        "{type_name} ends {left} bytes before the {length} bytes of the message do; \
         the sender has another definition of the type"
    )]
    Trailing {
        /// Rust name of the type.
        type_name: &'static str,
        /// Bytes after the last field.
        left: usize,
        /// Bytes there are, header included.
        length: usize,
    },
    /// The value cannot be written.
    #[error("cannot write {type_name} as CDR: {source}")]
    Encode {
        /// Rust name of the type.
        type_name: &'static str,
        /// What went wrong.
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

/// Writes a message, little endian, header included. Fails beyond 4 GiB.
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

/// Reads a message of either byte order. All bytes must belong to it but for up to 3 of padding.
///
/// Safe on hostile bytes: sequences grow with the elements that are really there, so memory stays
/// within a small multiple of the length of `bytes` whatever lengths it declares.
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
