use std::path::PathBuf;

use thiserror::Error;

use crate::param_value::{ScanError, ValueError};

/// Reason why a parameter file is refused.
#[derive(Debug, Error)]
pub enum ParamFileError {
    /// The file cannot be read.
    #[error("parameter file {path:?}: {source}")]
    Read {
        path: PathBuf,
        source: std::io::Error,
    },
    /// The path leads to a fifo, a directory or a device.
    #[error("parameter file {path:?} is no regular file")]
    NotAFile { path: PathBuf },
    /// The file is larger than any parameter file should be.
    #[error("parameter file {path:?} is larger than {bytes_max} bytes")]
    TooLarge { path: PathBuf, bytes_max: u64 },
    /// The file is no YAML, or has a key twice.
    #[error("parameter file {path:?}: {message}")]
    Yaml { path: PathBuf, message: String },
    /// The file has an anchor, an alias, or too deep nesting.
    #[error("parameter file {path:?}, {source}")]
    Scan { path: PathBuf, source: ScanError },
    /// The file is YAML of another shape.
    #[error("parameter file {path:?}, at `{key}`: found {found}, expected {expected}")]
    Shape {
        path: PathBuf,
        key: String,
        expected: &'static str,
        found: String,
    },
    /// The file has a value of no parameter type.
    #[error("parameter file {path:?}, at `{key}`: {source}")]
    Value {
        path: PathBuf,
        key: String,
        source: ValueError,
    },
}
