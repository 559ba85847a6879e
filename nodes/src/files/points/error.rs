//! Error of a point file.

use std::io;

use thiserror::Error;

use super::format::PointFormat;

/// Reason for rejecting a point file. Bytes count from 0, lines from 1, both after decompression.
#[derive(Debug, Error)]
pub enum PointFileError {
    /// The system could not open or read the file, or its bzip2 data is damaged.
    #[error("reading failed after byte {byte}: {source}")]
    Io {
        /// Bytes read before.
        byte: u64,
        /// Error of the system.
        source: io::Error,
    },
    /// Format that neither content nor extension identifies.
    #[error(
        "cannot tell the format from the content or the extension {extension:?}: \
         name the file .ply, .pcd, .las, .laz, .e57, .bt, .ot, .xyz, .txt, .asc, .csv or .bin, followed by .bz2 if packed"
    )]
    UnknownFormat {
        /// The extension, without .bz2.
        extension: String,
    },
    /// Invalid line of a header or of text data.
    #[error("{format} file, line {line}: {reason}")]
    Line {
        /// Format used for reading.
        format: PointFormat,
        /// Invalid line.
        line: u64,
        /// Fault and expected content.
        reason: String,
    },
    /// Invalid binary data.
    #[error("{format} file, at byte {byte}: {reason}")]
    Data {
        /// Format used for reading.
        format: PointFormat,
        /// Position in the file.
        byte: u64,
        /// Fault and expected content.
        reason: String,
    },
    /// Truncated file.
    #[error("the file is cut short: it ends at byte {byte}, in {part}")]
    Truncated {
        /// Length of the file.
        byte: u64,
        /// Part that was being read.
        part: String,
    },
    /// Compressed, in a build without decompression.
    #[cfg(not(feature = "bzip2"))]
    #[error("the file is packed with bzip2, which this build lacks: unpack it first")]
    Packed,
    /// Known but unsupported format.
    #[error("{what} is not read: {remedy}")]
    NotRead {
        /// Format, with the reason if it depends.
        what: &'static str,
        /// Conversion to a supported format.
        remedy: &'static str,
    },
    /// Point count above the caller's limit.
    #[error(
        "the file has {points} points or more, but at most {max_points} are allowed: raise the limit or thin the file"
    )]
    TooManyPoints {
        /// Points stated by a header, or read so far.
        points: u64,
        /// Limit of the caller.
        max_points: usize,
    },
}

#[cfg(feature = "survey")]
impl PointFileError {
    /// LAZ or E57 inside bzip2: both need random access.
    pub(super) const PACKED_TWICE: PointFileError = PointFileError::NotRead {
        what: "LAZ or E57 packed with bzip2",
        remedy: "unpack it with `bunzip2`",
    };
}
