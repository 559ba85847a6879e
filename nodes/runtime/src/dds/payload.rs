//! Samples as opaque CDR bytes: they are read and written outside the locks of RustDDS.

use std::convert::Infallible;
use std::sync::Mutex;

use rustdds::RepresentationIdentifier;
use rustdds::bytes::Bytes;
use rustdds::no_key::{Decode, DeserializerAdapter, SerializerAdapter};

use crate::port::ENCAPSULATION_BYTES;
use crate::sync::lock;

/// Body of a little-endian CDR sample, without its encapsulation header.
#[derive(Clone, Debug)]
pub(super) struct Payload(pub Bytes);

/// Hands a [`Payload`] to RustDDS as it is.
pub(super) struct PayloadSerializer;

impl SerializerAdapter<Payload> for PayloadSerializer {
    type Error = Infallible;

    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }

    fn to_bytes(value: &Payload) -> Result<Bytes, Infallible> {
        Ok(value.0.clone())
    }
}

/// Outcome of copying a sample out of the cache of RustDDS.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Taken {
    /// It lies in the buffer of the [`CopyInto`], encapsulation header first.
    Copied,
    /// Longer than allowed; not copied.
    TooLong {
        /// Its length, header included.
        bytes: usize,
    },
}

/// Accepts samples of every encoding, so that RustDDS neither drops nor dumps a foreign one.
pub(super) struct PayloadDeserializer;

impl DeserializerAdapter<Taken> for PayloadDeserializer {
    type Error = Infallible;
    type Decoded = Taken;

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        type Encoding = RepresentationIdentifier;
        const ALL: &[Encoding] = &[
            Encoding::CDR_LE,
            Encoding::CDR_BE,
            Encoding::PL_CDR_LE,
            Encoding::PL_CDR_BE,
            Encoding::XML,
            Encoding::XCDR2_LE,
            Encoding::XCDR2_BE,
            Encoding::D_CDR2_LE,
            Encoding::D_CDR2_BE,
            Encoding::PL_XCDR2_LE,
            Encoding::PL_XCDR2_BE,
            Encoding::CDR2_LE,
            Encoding::CDR2_BE,
            Encoding::PL_CDR2_LE,
            Encoding::PL_CDR2_BE,
            Encoding::D_CDR_LE,
            Encoding::D_CDR_BE,
        ];
        ALL
    }

    fn transform_decoded(decoded: Taken) -> Taken {
        decoded
    }
}

/// Copies a sample into a buffer that is used again for the next.
///
/// RustDDS calls it under the lock of its topic cache, where its event loop waits: it only copies.
#[derive(Clone)]
pub(super) struct CopyInto<'a> {
    pub buffer: &'a Mutex<Vec<u8>>,
    pub max_bytes: usize,
}

impl<'de> Decode<'de, Taken> for CopyInto<'_> {
    type Error = Infallible;

    fn decode_bytes(
        self,
        body: &'de [u8],
        encoding: RepresentationIdentifier,
    ) -> Result<Taken, Infallible> {
        let bytes = body.len().saturating_add(ENCAPSULATION_BYTES);
        if bytes > self.max_bytes {
            return Ok(Taken::TooLong { bytes });
        }
        let [high, low] = encoding.to_bytes();
        let mut buffer = lock(self.buffer);
        buffer.clear();
        buffer.reserve(bytes);
        buffer.extend_from_slice(&[high, low, 0, 0]);
        buffer.extend_from_slice(body);
        Ok(Taken::Copied)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_header_is_put_back() {
        let buffer = Mutex::new(vec![9; 100]);
        let copy = CopyInto {
            buffer: &buffer,
            max_bytes: 8,
        };
        let taken = copy
            .clone()
            .decode_bytes(&[1, 2, 3, 4], RepresentationIdentifier::CDR_BE);
        assert_eq!(taken, Ok(Taken::Copied));
        assert_eq!(*lock(&buffer), [0, 0, 0, 0, 1, 2, 3, 4]);
        let taken = copy.decode_bytes(&[0; 5], RepresentationIdentifier::CDR_LE);
        assert_eq!(taken, Ok(Taken::TooLong { bytes: 9 }));
        assert_eq!(lock(&buffer).len(), 8, "a long sample is not copied");
    }
}
