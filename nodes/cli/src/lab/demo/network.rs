//! The network of `lattice demo --indoor`.

use std::io::Write;
use std::path::{Path, PathBuf};

use lattice_nodes::files::whole;

use crate::CliResult;

/// The network that comes with the program: none yet.
const BUILT_IN: Option<&[u8]> = None;

/// Words where this build runs no networks.
const NO_ONNX: &str = "this build runs no networks: use `cargo run --release --features onnx --bin lattice -- demo --indoor`, \
     or add --true-labels, which does without";
/// Words where there is none to run.
const NO_NETWORK: &str = "no network comes with the program: the images are of true labels, as with --true-labels; --model names \
     one, in a build with `--features onnx`";

/// A file of the network that is given, or of the one that comes with the program, in a folder; none where there is
/// neither, which is told.
///
/// # Errors
/// If this build runs no networks.
pub fn model(given: Option<&PathBuf>, folder: &Path) -> CliResult<Option<PathBuf>> {
    if given.is_none() && BUILT_IN.is_none() {
        eprintln!("{NO_NETWORK}");
        return Ok(None);
    }
    if !cfg!(feature = "onnx") {
        return Err(NO_ONNX.into());
    }
    if let (None, Some(bytes)) = (given, BUILT_IN) {
        let path = folder.join("network.onnx");
        whole::write(&path, |file| file.write_all(bytes))?;
        return Ok(Some(path));
    }
    Ok(given.cloned())
}
