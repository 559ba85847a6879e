//! zstd compression of whole storage files and of individual messages, as in rosbag2; the output is bounded.

use std::{
    fs::File,
    io::{self, Read, Write},
    path::Path,
    sync::Arc,
};

use tempfile::{Builder, TempPath};

use super::{BagError, MAX_MESSAGE_BYTES};

/// Limit of decompressed file size: this, or the compressed size times the ratio below, whichever is more; bytes.
const MAX_FILE_BYTES: u64 = 4 << 30;
const MAX_FILE_RATIO: u64 = 64;

/// Decompresses `path` to a temporary file that is deleted with its last user.
pub(crate) fn decompress_file(path: &Path) -> Result<Arc<TempPath>, BagError> {
    let file = File::open(path).map_err(BagError::io(path, "open"))?;
    let size = file
        .metadata()
        .map_err(BagError::io(path, "examine"))?
        .len();
    let limit_bytes = size.saturating_mul(MAX_FILE_RATIO).max(MAX_FILE_BYTES);
    let mut target = Builder::new()
        .prefix("lattice_bag_")
        .tempfile()
        .map_err(BagError::io(
            &std::env::temp_dir(),
            "create a temporary file in",
        ))?;
    let damaged = |e: io::Error| {
        BagError::corrupt(
            path,
            "its zstd stream",
            format!("{e} ({size} bytes are there)"),
            "take another copy of the file; it is not whole",
        )
    };
    let mut decoder = zstd::stream::read::Decoder::new(file).map_err(damaged)?;
    let mut buffer = vec![0; 1 << 18];
    let mut size_bytes = 0_u64;
    loop {
        let read = decoder.read(&mut buffer).map_err(damaged)?;
        if read == 0 {
            break;
        }
        size_bytes = size_bytes.saturating_add(read as u64);
        if size_bytes > limit_bytes {
            return Err(BagError::TooLarge {
                path: path.to_path_buf(),
                what: "the decompressed file",
                position: "its end".into(),
                size_bytes,
                limit_bytes,
                remedy: "decompress it with `zstd -d` and open the result",
            });
        }
        let chunk = buffer.get(..read).unwrap_or_default();
        let target_path = target.path().to_path_buf();
        target
            .write_all(chunk)
            .map_err(BagError::io(&target_path, "write"))?;
    }
    Ok(Arc::new(target.into_temp_path()))
}

/// Decompresses one message; the error is a reason.
pub(crate) fn decompress_message(data: &[u8]) -> Result<Vec<u8>, String> {
    let decoder = zstd::stream::read::Decoder::with_buffer(data);
    let decoder = decoder.map_err(|e| format!("its zstd frame: {e}"))?;
    let mut message = Vec::new();
    let read = decoder
        .take(MAX_MESSAGE_BYTES + 1)
        .read_to_end(&mut message);
    match read.map_err(|e| format!("its zstd frame: {e}"))? as u64 {
        size if size > MAX_MESSAGE_BYTES => Err(format!(
            "its zstd frame holds more than the limit of {MAX_MESSAGE_BYTES} bytes"
        )),
        _ => Ok(message),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_decompress_and_damage_is_an_error() {
        let data: Vec<u8> = (0..10_000_u32)
            .flat_map(|i| (i % 251).to_le_bytes())
            .collect();
        let packed = zstd::encode_all(&data[..], 0).unwrap();
        assert_eq!(decompress_message(&packed).unwrap(), data);
        assert!(
            decompress_message(&packed[..packed.len() - 3])
                .unwrap_err()
                .contains("zstd")
        );
        assert!(decompress_message(b"no zstd at all").is_err());
    }

    #[test]
    fn files_decompress_and_the_temporary_file_goes_away() {
        let folder = tempfile::tempdir().unwrap();
        let packed = folder.path().join("a.zstd");
        std::fs::write(&packed, zstd::encode_all(&[7; 100_000][..], 0).unwrap()).unwrap();
        let temporary = decompress_file(&packed).unwrap();
        let place = temporary.to_path_buf();
        assert_eq!(std::fs::read(&place).unwrap(), vec![7; 100_000]);
        drop(temporary);
        assert!(!place.exists());

        let whole = std::fs::read(&packed).unwrap();
        std::fs::write(&packed, &whole[..whole.len() - 2]).unwrap();
        assert!(matches!(
            decompress_file(&packed),
            Err(BagError::Corrupt { .. })
        ));
    }
}
