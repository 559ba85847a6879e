//! The network of `lattice demo --indoor`.

use std::path::{Path, PathBuf};

use lattice_lab::models::write_rooms;

use crate::CliResult;

/// Words where this build runs no networks.
const NO_ONNX: &str = "this build runs no networks: use `cargo run --release --features onnx --bin lattice -- demo --indoor`, \
     or add --true-labels, which does without";

/// File of the network that is given, or of our own, which is written to a folder.
///
/// # Errors
/// If this build runs no networks.
pub fn model(given: Option<&PathBuf>, folder: &Path) -> CliResult<PathBuf> {
    if !cfg!(feature = "onnx") {
        return Err(NO_ONNX.into());
    }
    match given {
        Some(path) => Ok(path.clone()),
        None => write_rooms(folder),
    }
}
