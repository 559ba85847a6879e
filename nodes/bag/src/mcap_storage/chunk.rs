//! Decompresses one chunk as a stream and checks its CRC.

use std::{
    fs::File,
    io::{self, BufRead, BufReader, Read, Seek, SeekFrom},
};

use super::walk::{Event, RECORD_HEADER_BYTES, WalkError, walk};

/// Bytes of a chunk's header without the name of its compression.
const FIXED_HEADER_BYTES: u64 = 40;
/// Longest name of a compression.
const MAX_NAME_BYTES: u32 = 32;

/// The header of a chunk record.
#[derive(Debug)]
pub(super) struct ChunkHeader {
    pub start_ns: u64,
    pub end_ns: u64,
    uncompressed_size: u64,
    crc: u32,
    compression: String,
    compressed_size: u64,
}

impl ChunkHeader {
    fn read(reader: &mut dyn Read, record_len: u64) -> Result<ChunkHeader, String> {
        let cut = |e: io::Error| format!("chunk header: {e}");
        let header = ChunkHeader {
            start_ns: read_u64(reader).map_err(cut)?,
            end_ns: read_u64(reader).map_err(cut)?,
            uncompressed_size: read_u64(reader).map_err(cut)?,
            crc: read_u32(reader).map_err(cut)?,
            compression: String::new(),
            compressed_size: 0,
        };
        let name_len = read_u32(reader).map_err(cut)?;
        if name_len > MAX_NAME_BYTES {
            return Err(format!(
                "the name of its compression takes {name_len} bytes"
            ));
        }
        let mut compression = String::new();
        reader
            .take(u64::from(name_len))
            .read_to_string(&mut compression)
            .map_err(cut)?;
        let compressed_size = read_u64(reader).map_err(cut)?;
        let room = record_len.saturating_sub(FIXED_HEADER_BYTES + u64::from(name_len));
        if compressed_size > room {
            return Err(format!(
                "{compressed_size} compressed bytes in a record with room for {room}"
            ));
        }
        Ok(ChunkHeader {
            compression,
            compressed_size,
            ..header
        })
    }
}

/// Visits the records of the chunk record at `offset` of `len` bytes (without opcode and length).
pub(super) fn walk_chunk(
    file: &mut BufReader<File>,
    offset: u64,
    len: u64,
    visit: &mut dyn FnMut(u64, Event<'_>) -> Result<(), WalkError>,
) -> Result<ChunkHeader, WalkError> {
    let wrong = |reason: String| WalkError::Bad { at: 0, reason };
    file.seek(SeekFrom::Start(offset.saturating_add(RECORD_HEADER_BYTES)))
        .map_err(|e| wrong(e.to_string()))?;
    let header = ChunkHeader::read(file, len).map_err(wrong)?;
    let compressed = file.take(header.compressed_size);
    match header.compression.as_str() {
        "" => walk_content(compressed, &header, visit)?,
        "zstd" => {
            let decoder = zstd::stream::read::Decoder::with_buffer(compressed);
            walk_content(
                decoder.map_err(|e| wrong(format!("zstd: {e}")))?,
                &header,
                visit,
            )?;
        }
        "lz4" => {
            let decoder = lz4::Decoder::new(compressed).map_err(|e| wrong(format!("lz4: {e}")))?;
            walk_content(decoder, &header, visit)?;
        }
        other => {
            return Err(wrong(format!(
                "compression {other:?}; known are none, \"lz4\" and \"zstd\""
            )));
        }
    }
    Ok(header)
}

fn walk_content(
    content: impl Read,
    header: &ChunkHeader,
    visit: &mut dyn FnMut(u64, Event<'_>) -> Result<(), WalkError>,
) -> Result<(), WalkError> {
    let hashed = HashedReader {
        inner: content,
        hasher: crc32fast::Hasher::new(),
    };
    let mut reader = BufReader::with_capacity(1 << 16, hashed.take(header.uncompressed_size));
    walk(&mut reader, header.uncompressed_size, visit)?;
    // All records were read, so the buffer is at its end and everything went through the hash.
    let rest = reader
        .fill_buf()
        .map_err(|e| WalkError::bad(header.uncompressed_size, e))?
        .len();
    if rest > 0 {
        return Err(WalkError::bad(
            header.uncompressed_size,
            format!("{rest} bytes after the last record"),
        ));
    }
    let calculated = reader.into_inner().into_inner().hasher.finalize();
    // A writer that does not calculate CRCs stores 0.
    if header.crc != 0 && header.crc != calculated {
        let saved = header.crc;
        return Err(WalkError::bad(
            0,
            format!("chunk CRC {calculated:08X}, where {saved:08X} is stored"),
        ));
    }
    Ok(())
}

struct HashedReader<R> {
    inner: R,
    hasher: crc32fast::Hasher,
}

impl<R: Read> Read for HashedReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.inner.read(buffer)?;
        self.hasher.update(buffer.get(..read).unwrap_or_default());
        Ok(read)
    }
}

fn read_u64(reader: &mut dyn Read) -> io::Result<u64> {
    let mut bytes = [0; 8];
    reader.read_exact(&mut bytes)?;
    Ok(u64::from_le_bytes(bytes))
}

fn read_u32(reader: &mut dyn Read) -> io::Result<u32> {
    let mut bytes = [0; 4];
    reader.read_exact(&mut bytes)?;
    Ok(u32::from_le_bytes(bytes))
}
