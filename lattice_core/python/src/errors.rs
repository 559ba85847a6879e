//! Errors as the exceptions that NumPy raises.

use std::io;
use std::path::Path;

use lattice_core::voxels::file::FileError;
use pyo3::PyErr;
use pyo3::exceptions::{PyOSError, PyTypeError, PyValueError};

/// `ValueError`.
pub fn refuse(reason: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(reason.to_string())
}

/// `TypeError`.
pub fn mistyped(reason: impl std::fmt::Display) -> PyErr {
    PyTypeError::new_err(reason.to_string())
}

/// `OSError` of a path by its number: `FileNotFoundError`, `PermissionError` and so on.
pub fn of_path(path: &Path, error: &io::Error) -> PyErr {
    match error.raw_os_error() {
        Some(number) => {
            let text = error.to_string();
            let text = text.split(" (os error").next().unwrap_or_default();
            PyOSError::new_err((number, text.to_owned(), path.as_os_str().to_owned()))
        }
        None => refuse(format!("{}: {error}", path.display())),
    }
}

/// Error of a map file.
pub fn of_map_file(path: &Path, error: &FileError) -> PyErr {
    match error {
        FileError::Io { source, .. } if source.raw_os_error().is_some() => of_path(path, source),
        _ => refuse(format!("{}: {error}", path.display())),
    }
}
