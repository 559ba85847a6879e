//! Content of a damaged compressed chunk, as far as it decompresses.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

use mcap::records::op;

use super::records::{CHUNK_HEADER_BYTES, RECORD_HEADER_BYTES};
use crate::sniff::ZSTD_MAGIC;
use crate::zstd_files::decompress_sound;

/// Largest part of a damaged chunk that is read again, bytes.
const MAX_CHUNK_BYTES: u64 = 256 << 20;
/// Largest part of its content, bytes.
const MAX_CONTENT_BYTES: usize = 256 << 20;
/// Begin of an lz4 frame.
const LZ4_MAGIC: &[u8] = &[0x04, 0x22, 0x4d, 0x18];
/// Bytes after the fixed part of a chunk's head in which its content begins: the name of a compression.
const NAME_BYTES: usize = 8;

/// Content of the compressed chunk at a part of a file, up to its damage; `None`: there is no compressed chunk.
///
/// Neither the lengths nor the name of the compression are trusted.
pub(super) fn unpack(file: &mut File, (start, end): (u64, u64)) -> io::Result<Option<Vec<u8>>> {
    let fixed = RECORD_HEADER_BYTES as usize + CHUNK_HEADER_BYTES;
    file.seek(SeekFrom::Start(start))?;
    let mut record = file.by_ref().take(end.saturating_sub(start));
    let mut head = Vec::new();
    record
        .by_ref()
        .take((fixed + NAME_BYTES) as u64)
        .read_to_end(&mut head)?;
    if head.first() != Some(&op::CHUNK) {
        return Ok(None);
    }
    let magics = head.get(fixed..).unwrap_or_default().windows(4).enumerate();
    let found = magics.filter(|(_, magic)| *magic == ZSTD_MAGIC || *magic == LZ4_MAGIC);
    let Some((at, magic)) = found.map(|(at, magic)| (fixed + at, magic.to_vec())).next() else {
        return Ok(None);
    };
    let mut frames = head.split_off(at);
    record.take(MAX_CHUNK_BYTES).read_to_end(&mut frames)?;
    Ok(Some(match magic == ZSTD_MAGIC {
        true => unzstd(&frames),
        false => unlz4(&frames),
    }))
}

fn unzstd(frames: &[u8]) -> Vec<u8> {
    let mut content = Vec::new();
    // The damage is known already.
    let _ = decompress_sound(frames, |part| {
        content.extend_from_slice(part);
        match content.len() > MAX_CONTENT_BYTES {
            true => Err(io::Error::from(io::ErrorKind::FileTooLarge)),
            false => Ok(()),
        }
    });
    content
}

fn unlz4(frame: &[u8]) -> Vec<u8> {
    let mut content = Vec::new();
    let Ok(mut decoder) = lz4::Decoder::new(Trickle(frame)) else {
        return content;
    };
    let mut part = vec![0; 1 << 16];
    while content.len() <= MAX_CONTENT_BYTES
        && let Ok(read) = decoder.read(&mut part)
        && read > 0
    {
        content.extend_from_slice(part.get(..read).unwrap_or_default());
    }
    content
}

/// A source of one byte at a time: the decoder's output before an error would be lost with it.
struct Trickle<'a>(&'a [u8]);

impl Read for Trickle<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let most = buffer.len().min(1);
        let read = self.0.read(buffer.get_mut(..most).unwrap_or_default())?;
        Ok(read)
    }
}
