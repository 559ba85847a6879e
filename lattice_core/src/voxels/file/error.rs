//! Errors of reading and writing map files.

use std::io;

use thiserror::Error;

/// Reason that a map was not read or written; positions are bytes from the start of the file.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum FileError {
    /// Input or output error.
    #[error("input or output of the map file failed at byte {position}: {source}")]
    Io { position: u64, source: io::Error },
    /// Other file type.
    #[error("not a map file: it starts with {:?} instead of \"LATTICE2\"", found.escape_ascii().to_string())]
    Magic { found: [u8; 8] },
    /// Format 1, before 2026-11, without sections.
    #[error(
        "the map file has format 1, which is not supported any more: create the map again from its log"
    )]
    OldVersion,
    /// Truncated file.
    #[error("the map file is cut short: it ends at byte {position}, within the {part}")]
    Truncated { position: u64, part: String },
    /// More voxels than the caller allows.
    #[error("the map file has {voxels} voxels, above the limit of {max_voxels}: raise max_voxels")]
    TooManyVoxels { voxels: u64, max_voxels: usize },
    /// More memory than the caller allows.
    #[error(
        "the {voxels} voxels of the map file take more than {max_bytes} bytes: raise max_bytes"
    )]
    TooLarge { voxels: u64, max_bytes: usize },
    /// Bytes that are not a map.
    #[error("the map file is damaged at byte {position}: {reason}")]
    Corrupt { position: u64, reason: String },
    /// Checksum mismatch.
    #[error(
        "the map file is damaged between bytes {start} and {end}, the {part}: their CRC should be {saved:08x}, but is {calculated:08x}"
    )]
    Checksum {
        start: u64,
        end: u64,
        part: String,
        saved: u32,
        calculated: u32,
    },
    /// Data after the end marker.
    #[error("data follow the end of the map at byte {position}")]
    TrailingBytes { position: u64 },
    /// Lattice that readers reject.
    #[error("the lattice cannot be written: {0}")]
    Lattice(String),
    /// zstd level that readers need not support.
    #[error("zstd level {0} is outside 1..=19")]
    Level(i32),
}
