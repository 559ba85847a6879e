use std::path::PathBuf;

use thiserror::Error;

use crate::config::param_value::{ScanError, ValueError};

/// Reason for rejecting a parameter file.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ParamFileError {
    /// The file cannot be read.
    #[error("parameter file {path:?}: {source}")]
    Read {
        path: PathBuf,
        source: std::io::Error,
    },
    /// The path is a fifo, a directory or a device.
    #[error("parameter file {path:?} is not a regular file")]
    NotAFile { path: PathBuf },
    /// The file exceeds the size limit.
    #[error("parameter file {path:?} is larger than {bytes_max} bytes")]
    TooLarge { path: PathBuf, bytes_max: u64 },
    /// Invalid YAML, or a duplicate key.
    #[error("parameter file {path:?}: {message}")]
    Yaml { path: PathBuf, message: String },
    /// The file has an anchor, an alias, or excessive nesting.
    #[error("parameter file {path:?}, {source}")]
    Scan { path: PathBuf, source: ScanError },
    /// The YAML has another structure.
    #[error("parameter file {path:?}, at `{key}`: found {found}, expected {expected}")]
    Shape {
        path: PathBuf,
        key: String,
        expected: &'static str,
        found: String,
    },
    /// A value has no parameter type.
    #[error("parameter file {path:?}, at `{key}`: {source}")]
    Value {
        path: PathBuf,
        key: String,
        source: ValueError,
    },
}
