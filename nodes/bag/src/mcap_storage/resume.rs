//! Resynchronisation after damage in an MCAP file: the next plausible chunk head.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

use mcap::records::op;

use super::records::{CHUNK_HEADER_BYTES, RECORD_HEADER_BYTES};

/// Window size, and the largest length of a chunk's head with its compression name.
const WINDOW_BYTES: usize = 1 << 20;
const HEAD_BYTES: usize = RECORD_HEADER_BYTES as usize + CHUNK_HEADER_BYTES + 4;

/// First byte from `from` on where a chunk of a file of `size` bytes seems to begin.
pub(super) fn next_chunk(file: &mut File, from: u64, size: u64) -> io::Result<Option<u64>> {
    let mut at = from;
    let mut window = Vec::new();
    while at < size {
        file.seek(SeekFrom::Start(at))?;
        window.clear();
        let most = (WINDOW_BYTES + HEAD_BYTES) as u64;
        let read = file.by_ref().take(most).read_to_end(&mut window)?;
        let places = window.windows(HEAD_BYTES).take(WINDOW_BYTES).zip(at..);
        let mut chunks = places.filter(|(head, byte)| is_chunk(head, size - byte));
        if let Some((_, byte)) = chunks.next() {
            return Ok(Some(byte));
        }
        if (read as u64) < most {
            return Ok(None);
        }
        at += WINDOW_BYTES as u64;
    }
    Ok(None)
}

/// True for a plausible chunk head with consistent lengths, within `left_bytes` of the file.
fn is_chunk(head: &[u8], left_bytes: u64) -> bool {
    let number = |from: usize, bytes: usize| {
        let part = head.get(from..from + bytes)?;
        let folded = part.iter().rev().fold(0_u64, |n, &b| n << 8 | u64::from(b));
        Some(folded)
    };
    let lengths = || {
        let record = number(1, 8)?;
        // After two times, the content size and its checksum.
        let name = number(37, 4).filter(|name| [0, 3, 4].contains(name))?;
        let content = number(41 + usize::try_from(name).ok()?, 8)?;
        Some((record, name.saturating_add(content)))
    };
    head.first() == Some(&op::CHUNK)
        && lengths().is_some_and(|(record, content)| {
            record == content.saturating_add(CHUNK_HEADER_BYTES as u64)
                && record <= left_bytes.saturating_sub(RECORD_HEADER_BYTES)
        })
}
