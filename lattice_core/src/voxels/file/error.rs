//! Errors of writing and reading map files.

use std::io;

use thiserror::Error;

/// A map that was not written or read; positions are bytes from the start of the file.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum FileError {
    /// The system could not read or write.
    #[error("input or output of the map file failed at byte {position}: {source}")]
    Io { position: u64, source: io::Error },
    /// Not a map file.
    #[error("not a map file: it starts with {:?} instead of \"LATTICE2\"", found.escape_ascii().to_string())]
    Magic { found: [u8; 8] },
    /// The format of before 2026-11, without sections.
    #[error("the map file has format 1, which is no longer read: make the map again from its log")]
    OldVersion,
    /// The end comes too early.
    #[error("the map file is cut short: it ends at byte {position}, within the {part}")]
    Truncated { position: u64, part: String },
    /// More voxels than the caller allows.
    #[error(
        "the map file has {voxels} voxels, but at most {max_voxels} are allowed: raise max_voxels"
    )]
    TooManyVoxels { voxels: u64, max_voxels: usize },
    /// More than the caller allows to be held.
    #[error(
        "the {voxels} voxels of the map file take more than {max_bytes} bytes: raise max_bytes"
    )]
    TooLarge { voxels: u64, max_bytes: usize },
    /// The bytes cannot be a map.
    #[error("the map file is damaged at byte {position}: {reason}")]
    Corrupt { position: u64, reason: String },
    /// A checksum does not match.
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
    /// Something follows the end marker.
    #[error("the map ends at byte {position}, but the file goes on")]
    TrailingBytes { position: u64 },
    /// No reader would take the lattice of the map.
    #[error("the lattice cannot be written: {0}")]
    Lattice(String),
    /// The writer was asked for a level that readers of the format need not take.
    #[error("zstd level {0} is not between 1 and 19")]
    Level(i32),
}
