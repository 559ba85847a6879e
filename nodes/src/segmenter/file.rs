//! Reading and validation of model files, common to all backends.

use std::io::{Cursor, Read};
use std::path::Path;

use tract_onnx::Onnx;
use tract_onnx::pb::ModelProto;
use tract_onnx::prelude::Framework;

use super::checks::{self, MAX_TENSOR_VALUES};
use super::names;
use super::network::{ModelError, Network, Size, Values};
use crate::files::regular_file::open;

/// Largest model file, bytes: the format is limited to 2 GiB.
const MAX_MODEL_BYTES: u64 = 1 << 30;

/// Bytes of a model's file.
pub(super) fn read(path: &Path) -> Result<Vec<u8>, ModelError> {
    let on_error = |error| ModelError::File {
        path: path.to_owned(),
        error,
    };
    let file = open(path).map_err(on_error)?;
    let bytes = file.metadata().map_err(on_error)?.len();
    if bytes > MAX_MODEL_BYTES {
        return Err(ModelError::Large {
            path: path.to_owned(),
            bytes,
            max: MAX_MODEL_BYTES,
        });
    }
    let mut read = Vec::new();
    file.take(MAX_MODEL_BYTES)
        .read_to_end(&mut read)
        .map_err(on_error)?;
    Ok(read)
}

/// Validated graph of a file, and its class names.
pub(super) fn checked(
    bytes: &[u8],
    path: &Path,
    onnx: &Onnx,
    known: impl Fn(&str) -> bool,
) -> Result<(ModelProto, Vec<String>), String> {
    let proto = onnx
        .proto_model_for_read(&mut Cursor::new(bytes))
        .map_err(|_| "not an ONNX file".to_owned())?;
    checks::model(&proto, known)?;
    let metadata = proto.metadata_props.iter();
    let metadata = metadata.map(|entry| (entry.key.as_str(), entry.value.as_str()));
    let names = names::of_model(metadata, path)?;
    Ok((proto, names))
}

/// Input size of a model: its own (1 x 3 x rows x columns), or the given one if that is dynamic;
/// `None`: another shape.
pub(super) fn input_size(
    dims: &[Option<usize>],
    given: Option<Size>,
) -> Option<Result<Size, String>> {
    let &[batch, channels, height, width] = dims else {
        return None;
    };
    if batch.unwrap_or(1) != 1 || channels.unwrap_or(3) != 3 {
        return None;
    }
    let own = |own: Option<usize>, given: Option<usize>| match (own, given) {
        (Some(own), Some(given)) if own != given => Err(format!(
            "its input has {own} pixels, but `input_size` is {given}"
        )),
        (None, None) => Err("its input size is dynamic: set `input_size`".to_owned()),
        (own, given) => Ok(own.or(given).unwrap_or(1)),
    };
    let size = || {
        let size = Size {
            width: own(width, given.map(|size| size.width))?,
            height: own(height, given.map(|size| size.height))?,
        };
        let pixels = size.pixels();
        if pixels == 0 || pixels > MAX_TENSOR_VALUES / 3 {
            return Err(format!("its input has {pixels} pixels"));
        }
        Ok(size)
    };
    Some(size())
}

/// Runs a network once, so that mismatches appear at the start.
pub(super) fn tried<N: Network>(network: N) -> Result<N, String> {
    let scores = network.run(vec![0.0; 3 * network.input().pixels()])?;
    let names = network.names().len();
    match scores.values {
        Values::Scores { classes, .. } if names > 0 && names != classes => {
            Err(format!("it has {classes} classes and {names} names"))
        }
        _ => Ok(network),
    }
}

/// Error for an output that is neither scores nor classes.
pub(super) fn other_output(kind: impl std::fmt::Debug, shape: impl std::fmt::Debug) -> String {
    format!(
        "its output is {kind:?} of {shape:?}, expected scores of 1 x classes x rows x columns or integers of 1 x \
         rows x columns"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_are_regular_files() {
        let folder = tempfile::tempdir().unwrap();
        let fifo = folder.path().join("fifo.onnx");
        let made = std::process::Command::new("mkfifo").arg(&fifo).status();
        assert!(made.unwrap().success());
        let link = folder.path().join("link.onnx");
        std::os::unix::fs::symlink(&fifo, &link).unwrap();
        // Each would wait, or never end.
        for path in [
            fifo.as_path(),
            link.as_path(),
            Path::new("/dev/zero"),
            folder.path(),
        ] {
            let error = read(path).unwrap_err().to_string();
            assert!(error.contains("not a regular file"), "{error}");
        }
        let file = folder.path().join("model.onnx");
        std::fs::write(&file, "x").unwrap();
        assert_eq!(read(&file).unwrap(), b"x");
    }
}
