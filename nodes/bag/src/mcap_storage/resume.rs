//! The way on behind damage of an MCAP file: the next chunk whose head is plausible.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

use mcap::records::op;

use super::records::{CHUNK_HEADER_BYTES, RECORD_HEADER_BYTES};

/// Bytes that are looked at at once, and those that a chunk's head takes with the name of its compression.
const WINDOW_BYTES: usize = 1 << 20;
const HEAD_BYTES: usize = RECORD_HEADER_BYTES as usize + CHUNK_HEADER_BYTES + 4;

/// First byte at or behind `from` where a chunk of a file of `size` bytes seems to begin.
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

/// True if these bytes, of so many to the end of the file, are a chunk's head whose two lengths agree.
fn is_chunk(head: &[u8], left_bytes: u64) -> bool {
    let number = |from: usize, bytes: usize| {
        let part = head.get(from..from + bytes)?;
        let folded = part.iter().rev().fold(0_u64, |n, &b| n << 8 | u64::from(b));
        Some(folded)
    };
    let lengths = || {
        let record = number(1, 8)?;
        // Behind two times, the size of the content and its checksum.
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
