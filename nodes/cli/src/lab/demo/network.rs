//! The network of `lattice demo --indoor`.

use std::path::{Path, PathBuf};

use crate::CliResult;

/// Words where there is no network to run.
#[cfg(not(feature = "onnx"))]
const WITHOUT: &str = "this build runs no networks: use `cargo run --release --features onnx --bin lattice -- demo --indoor`, \
     or add --true-labels, which does without";
#[cfg(feature = "onnx")]
const WITHOUT: &str = "no network comes with this build: name one by --model, or add --true-labels, which does without";

/// A network in an ONNX file.
pub struct Network(PathBuf);

impl Network {
    /// The one that is given.
    ///
    /// # Errors
    /// If there is none, or this build runs none.
    pub fn find(given: Option<PathBuf>) -> CliResult<Self> {
        match given.filter(|_| cfg!(feature = "onnx")) {
            Some(path) => Ok(Self(path)),
            None => Err(WITHOUT.into()),
        }
    }

    /// Its file.
    pub fn file_in(self, _folder: &Path) -> CliResult<PathBuf> {
        Ok(self.0)
    }
}
