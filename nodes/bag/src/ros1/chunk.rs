//! Content of chunks: uncompressed, bz2 or lz4.

use std::fs::File;
use std::io::{self, Read};

use bzip2::read::MultiBzDecoder;

use super::record::{Cause, Head, MAX_DATA_BYTES, RecordError};

/// Content of a chunk, as far as it is readable.
pub(super) struct Content {
    pub bytes: Vec<u8>,
    /// Damage behind the bytes; their own checksum may be missing then.
    pub damage: Option<RecordError>,
    pub compressed: bool,
}

/// Reads the content of a chunk. Memory grows with the bytes read, up to the stated size.
pub(super) fn content(file: &mut File, head: &Head) -> Result<Content, RecordError> {
    let wrong = |reason: String| RecordError::bad(head.place, reason);
    let fields = head.fields();
    let size = fields.u32("size").map(u64::from);
    let size = size.ok_or_else(|| wrong("a chunk without size".into()))?;
    let compression = fields.get("compression").unwrap_or_default();
    if size > MAX_DATA_BYTES {
        let cause = Cause::TooLarge {
            what: "the content of a chunk",
            size_bytes: size,
            limit_bytes: MAX_DATA_BYTES,
        };
        return Err(RecordError {
            place: head.place,
            cause,
        });
    }
    let is_open = size == 0 && head.data_bytes() == 0;
    let data = head.data(file)?;
    let (bytes, ended) = match compression {
        b"none" => (data, Ok(())),
        // A recorder writes the sizes of a chunk once it is complete.
        b"bz2" | b"lz4" if is_open => {
            let cause = Cause::Cut;
            return Err(RecordError {
                place: head.place,
                cause,
            });
        }
        b"bz2" => decompressed(MultiBzDecoder::new(data.as_slice()), size),
        b"lz4" => match lz4::Decoder::new(data.as_slice()) {
            Ok(decoder) => decompressed(decoder, size),
            Err(error) => (Vec::new(), Err(error)),
        },
        other => {
            let name = String::from_utf8_lossy(other.get(..20).unwrap_or(other)).into_owned();
            return Err(wrong(format!(
                "a chunk of compression {name:?}, not none, bz2 or lz4"
            )));
        }
    };
    let damage = match ended {
        Err(error) => Some(wrong(format!("a chunk that does not decompress: {error}"))),
        Ok(()) if bytes.len() as u64 != size => Some(wrong(format!(
            "a chunk of {} bytes that states {size}",
            bytes.len()
        ))),
        Ok(()) => None,
    };
    Ok(Content {
        bytes,
        damage,
        compressed: compression != b"none",
    })
}

/// Up to `size` decompressed bytes and one more, and the error behind them.
fn decompressed(decoder: impl Read, size: u64) -> (Vec<u8>, io::Result<()>) {
    let mut bytes = Vec::new();
    // What precedes an error stays.
    let ended = decoder.take(size.saturating_add(1)).read_to_end(&mut bytes);
    (bytes, ended.map(drop))
}
