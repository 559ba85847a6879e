//! Errors of the generator.

use std::io;
use std::path::PathBuf;

/// Reason for which no code was written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GenerateError {
    /// A file or folder could not be read or written.
    #[error("{path}: {source}")]
    File {
        /// File or folder.
        path: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// A definition is malformed.
    #[error("{file}:{line}: {reason}")]
    Definition {
        /// File of the definition.
        file: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Fault of the line.
        reason: String,
    },
    /// A folder without a `.msg`, `.srv` or `.action` file.
    #[error("{0}: no .msg, .srv or .action file, neither here nor in msg/, srv/ and action/")]
    NoDefinitions(PathBuf),
    /// The variable `OUT_DIR` is not set: the program is no build script.
    #[error("OUT_DIR is not set: call this in a build script, or name a folder with `write_to`")]
    NoOutDir,
}
