//! Error of a point file.

use std::io;

use thiserror::Error;

use super::PointFormat;

/// Error of a point file. Bytes count from 0, lines from 1, both after unpacking.
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
    /// Neither the content nor the name tells what it is.
    #[error(
        "cannot tell the format from the content or the extension {extension:?}: \
         name the file .ply, .pcd, .las, .laz, .e57, .bt, .xyz, .txt, .csv or .bin, followed by .bz2 if packed"
    )]
    UnknownFormat {
        /// The extension, without .bz2.
        extension: String,
    },
    /// A line of a header or of text data is wrong.
    #[error("{format} file, line {line}: {reason}")]
    Line {
        /// Kind that the file was read as.
        format: PointFormat,
        /// Line of the fault.
        line: u64,
        /// Problem, with what was expected.
        reason: String,
    },
    /// Binary data is wrong.
    #[error("{format} file, at byte {byte}: {reason}")]
    Data {
        /// Kind that the file was read as.
        format: PointFormat,
        /// Place of the problem.
        byte: u64,
        /// Problem, with what was expected.
        reason: String,
    },
    /// The end comes too early.
    #[error("the file is cut short: it ends at byte {byte}, in {part}")]
    Truncated {
        /// Length of the file.
        byte: u64,
        /// Part that was being read.
        part: String,
    },
    /// Packed, where this build cannot unpack.
    #[cfg(not(feature = "bzip2"))]
    #[error("the file is packed with bzip2, which this build lacks: unpack it first")]
    Packed,
    /// A kind that is known but not read.
    #[error("{what} is not read: {remedy}")]
    NotRead {
        /// Kind of the file, and why if it depends.
        what: &'static str,
        /// Way to a file that is read.
        remedy: &'static str,
    },
    /// More points than the caller allows.
    #[error(
        "the file has {points} points or more, but at most {max_points} are allowed: raise the limit or thin the file"
    )]
    TooManyPoints {
        /// Points promised by a header, or found so far.
        points: u64,
        /// Limit of the caller.
        max_points: usize,
    },
}

#[cfg(feature = "survey")]
impl PointFileError {
    /// LAZ or E57, which are read in no order, inside of bzip2.
    pub(super) const PACKED_TWICE: PointFileError = PointFileError::NotRead {
        what: "LAZ or E57 packed with bzip2",
        remedy: "unpack it with `bunzip2`",
    };
}
