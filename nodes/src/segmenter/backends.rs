//! Networks of files, by backend.

use std::path::Path;

use super::network::{Backend, ModelError, Network, Size};
#[cfg(feature = "ort")]
use super::onnx_runtime;
#[cfg(feature = "onnx")]
use super::tract;

/// Loads the network of a file for tract. `size` is its input size if dynamic.
///
/// Errors name the file and the problem; without the feature `onnx` no network can be loaded.
pub fn read_network(
    path: &Path,
    size: Option<Size>,
    threads: usize,
) -> Result<Box<dyn Network>, ModelError> {
    read_network_by(Backend::Tract, path, size, threads)
}

/// Loads the network of a file with one of the available backends.
#[cfg_attr(
    not(feature = "onnx"),
    expect(unused_variables, reason = "there is no backend")
)]
pub fn read_network_by(
    backend: Backend,
    path: &Path,
    size: Option<Size>,
    threads: usize,
) -> Result<Box<dyn Network>, ModelError> {
    match backend {
        #[cfg(feature = "onnx")]
        Backend::Tract => Ok(Box::new(tract::OnnxNetwork::read(path, size, threads)?)),
        #[cfg(not(feature = "onnx"))]
        Backend::Tract => Err(ModelError::NotBuilt("onnx")),
        #[cfg(feature = "ort")]
        Backend::Ort => Ok(Box::new(onnx_runtime::OrtNetwork::read(
            path, size, threads,
        )?)),
        #[cfg(not(feature = "ort"))]
        Backend::Ort => Err(ModelError::NotBuilt("ort")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn backends_that_are_not_built_in_say_how_they_are() {
        let refused = |backend| {
            let found = read_network_by(backend, Path::new("/nowhere"), None, 1);
            found
                .err()
                .map(|error| error.to_string())
                .unwrap_or_default()
        };
        for (backend, feature, is_built) in [
            (Backend::Tract, "onnx", cfg!(feature = "onnx")),
            (Backend::Ort, "ort", cfg!(feature = "ort")),
        ] {
            let expected = format!("build it with `--features {feature}`");
            assert_eq!(refused(backend).contains(&expected), !is_built, "{feature}");
        }
    }
}
