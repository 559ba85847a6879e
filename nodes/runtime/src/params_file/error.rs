use std::path::PathBuf;

use thiserror::Error;

use crate::param_value::{ScanError, ValueError};

/// Reason why a parameter file is refused.
#[derive(Debug, Error)]
pub enum ParamFileError {
    /// The file cannot be read.
    #[error("parameter file {path:?}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The path leads to a fifo, a directory or a device.
    #[error("parameter file {path:?} is no regular file")]
    NotAFile {
        /// The path.
        path: PathBuf,
    },
    /// The file is larger than any parameter file should be.
    #[error("parameter file {path:?} is larger than {bytes_max} bytes")]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// The limit, bytes.
        bytes_max: u64,
    },
    /// The file is no YAML, or has a key twice.
    #[error("parameter file {path:?}: {message}")]
    Yaml {
        /// The file.
        path: PathBuf,
        /// What the YAML reader says, with line and column.
        message: String,
    },
    /// The file has an anchor, an alias, or too deep nesting.
    #[error("parameter file {path:?}, {source}")]
    Scan {
        /// The file.
        path: PathBuf,
        /// What it has, and where.
        source: ScanError,
    },
    /// The file is YAML of another shape.
    #[error("parameter file {path:?}, at `{key}`: found {found}, expected {expected}")]
    Shape {
        /// The file.
        path: PathBuf,
        /// The keys that lead there.
        key: String,
        /// What is allowed.
        expected: &'static str,
        /// What is there.
        found: String,
    },
    /// The file has a value of no parameter type.
    #[error("parameter file {path:?}, at `{key}`: {source}")]
    Value {
        /// The file.
        path: PathBuf,
        /// The keys that lead there.
        key: String,
        /// What is wrong with it.
        source: ValueError,
    },
}
