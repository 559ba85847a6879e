//! zstd compression of whole storage files and of individual messages, as in rosbag2; the output is bounded.

use std::{
    fs::File,
    io::{self, BufReader, Read, Write},
    path::Path,
    sync::Arc,
};

use tempfile::{Builder, TempPath};
use zstd::stream::raw::{Decoder, Operation};

use super::{BagError, MAX_MESSAGE_BYTES};

/// Limit of decompressed file size: this, or the compressed size times the ratio below, whichever is more; bytes.
const MAX_FILE_BYTES: u64 = 4 << 30;
const MAX_FILE_RATIO: u64 = 64;

/// Limits of one step of decompression, bytes: a block with the head of the next one.
const STEP_BYTES: usize = 1 << 18;

/// Damage of a stream, after which nothing can be decompressed.
pub(crate) enum Damage {
    /// It ends inside a frame.
    Cut,
    /// Text of zstd.
    Bad(String),
}

/// Decompresses a stream block by block, so that all data before a damage reach `put`.
pub(crate) fn decompress_sound(
    mut source: impl Read,
    mut put: impl FnMut(&[u8]) -> io::Result<()>,
) -> io::Result<Option<Damage>> {
    let mut decoder = Decoder::new()?;
    let (mut input, mut output) = (Vec::new(), vec![0; STEP_BYTES]);
    // Of the rest of the block; 0 between frames.
    let mut remaining = 0;
    loop {
        input.clear();
        let most = remaining.clamp(1, STEP_BYTES) as u64;
        source.by_ref().take(most).read_to_end(&mut input)?;
        if input.is_empty() {
            return Ok((remaining > 0).then_some(Damage::Cut));
        }
        let mut rest = input.as_slice();
        loop {
            let status = match decoder.run_on_buffers(rest, &mut output) {
                Ok(status) => status,
                Err(error) => return Ok(Some(Damage::Bad(error.to_string()))),
            };
            put(output.get(..status.bytes_written).unwrap_or_default())?;
            rest = rest.get(status.bytes_read..).unwrap_or_default();
            remaining = status.remaining;
            let is_full = status.bytes_written == output.len();
            let is_stuck = status.bytes_written == 0 && status.bytes_read == 0;
            if !is_full && rest.is_empty() || is_stuck {
                break;
            }
        }
    }
}

/// Decompresses `path` to a temporary file that is deleted with its last user; up to a damage, if any.
pub(crate) fn decompress_file(path: &Path) -> Result<(Arc<TempPath>, Option<BagError>), BagError> {
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
    let target_path = target.path().to_path_buf();
    let (mut size_bytes, mut failed) = (0_u64, None);
    let ended = decompress_sound(BufReader::with_capacity(STEP_BYTES, file), |part| {
        size_bytes = size_bytes.saturating_add(part.len() as u64);
        let error = match size_bytes > limit_bytes {
            true => BagError::TooLarge {
                path: path.to_path_buf(),
                what: "the decompressed file",
                position: "its end".into(),
                size_bytes,
                limit_bytes,
                remedy: "decompress it with `zstd -d` and open the result",
            },
            false => match target.write_all(part) {
                Ok(()) => return Ok(()),
                Err(error) => BagError::io(&target_path, "write")(error),
            },
        };
        failed = Some(error);
        Err(io::Error::from(io::ErrorKind::Other))
    });
    if let Some(error) = failed {
        return Err(error);
    }
    let damage = ended.map_err(BagError::io(path, "read"))?;
    let damage = damage.map(|damage| match damage {
        Damage::Cut => BagError::Truncated {
            path: path.to_path_buf(),
            size_bytes: size,
            inside: "its zstd stream".to_owned(),
            readable_messages: 0,
        },
        Damage::Bad(reason) => BagError::corrupt(
            path,
            "its zstd stream",
            format!("{reason} ({size} bytes are there)"),
            "take another copy, or rescue the rest with `lattice bag recover`",
        ),
    });
    match damage {
        Some(damage) if size_bytes == 0 => Err(damage),
        damage => Ok((Arc::new(target.into_temp_path()), damage)),
    }
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
        let (temporary, damage) = decompress_file(&packed).unwrap();
        assert!(damage.is_none());
        let place = temporary.to_path_buf();
        assert_eq!(std::fs::read(&place).unwrap(), vec![7; 100_000]);
        drop(temporary);
        assert!(!place.exists());

        let text = crate::tests::noise(1, 1_000_000);
        let whole = zstd::encode_all(&text[..], 0).unwrap();
        for cut in [1, whole.len() / 2, whole.len() - 2] {
            std::fs::write(&packed, &whole[..cut]).unwrap();
            let (part, damage) = match decompress_file(&packed) {
                Ok((copy, damage)) => (std::fs::read(&*copy).unwrap(), damage),
                Err(error) => (vec![], Some(error)),
            };
            assert!(matches!(damage, Some(BagError::Truncated { .. })), "{cut}");
            let least = (text.len() * cut / whole.len()).saturating_sub(1 << 17);
            assert!(part.len() >= least && part == text[..part.len()], "{cut}");
        }
    }
}
