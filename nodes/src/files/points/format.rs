//! Kinds of point files, by name and by content.

use std::fmt;
use std::path::Path;

use super::PointFileError;

/// The kinds of point file that are read.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum PointFormat {
    /// PLY with text data.
    PlyAscii,
    /// PLY, little endian.
    PlyBinaryLittleEndian,
    /// PLY, big endian.
    PlyBinaryBigEndian,
    /// PCD with text data.
    PcdAscii,
    /// PCD, point by point.
    PcdBinary,
    /// PCD, field by field, LZF-compressed.
    PcdBinaryCompressed,
    /// Columns of numbers.
    Text,
    /// KITTI scan: x, y, z and intensity as 32-bit floats.
    KittiBin,
}

impl fmt::Display for PointFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            PointFormat::PlyAscii => "PLY (ascii)",
            PointFormat::PlyBinaryLittleEndian => "PLY (binary little endian)",
            PointFormat::PlyBinaryBigEndian => "PLY (binary big endian)",
            PointFormat::PcdAscii => "PCD (ascii)",
            PointFormat::PcdBinary => "PCD (binary)",
            PointFormat::PcdBinaryCompressed => "PCD (binary compressed)",
            PointFormat::Text => "text",
            PointFormat::KittiBin => "KITTI bin",
        })
    }
}

/// Formats that share a reader.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Family {
    Ply,
    Pcd,
    Text,
    Kitti,
}

/// True if the bytes are the start of a bzip2 stream with a block in it.
pub(super) fn is_bzip2(start: &[u8]) -> bool {
    let block = start.get(4..10) == Some(&[0x31, 0x41, 0x59, 0x26, 0x53, 0x59]);
    start.starts_with(b"BZh") && block
}

/// Length of what can only be the start of a bzip2 stream that ends before its first block.
pub(super) fn cut_bzip2(start: &[u8]) -> Option<u64> {
    const HEAD: [u8; 10] = *b"BZh91AY&SY";
    let is_start = match start {
        [b'B', b'Z', b'h', b'1'..=b'9', rest @ ..] => HEAD.get(4..)?.starts_with(rest),
        _ => false,
    };
    is_start.then_some(start.len() as u64)
}

/// The family by the first bytes of the content, or else by the extension.
pub(super) fn detect(start: &[u8], name: &Path) -> Result<Family, PointFileError> {
    if start.starts_with(b"ply\n") || start.starts_with(b"ply\r") {
        return Ok(Family::Ply);
    }
    if start.starts_with(b"# .PCD") || start.starts_with(b"VERSION ") {
        return Ok(Family::Pcd);
    }
    let extension = name.extension().unwrap_or_default().to_string_lossy();
    match extension.to_ascii_lowercase().as_str() {
        "ply" => Ok(Family::Ply),
        "pcd" => Ok(Family::Pcd),
        "xyz" | "txt" | "asc" | "csv" => Ok(Family::Text),
        "bin" => Ok(Family::Kitti),
        _ => Err(PointFileError::UnknownFormat {
            extension: extension.into_owned(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_content_outranks_the_name() {
        let detect = |start: &[u8], name: &str| detect(start, Path::new(name)).ok();
        assert_eq!(detect(b"ply\r\nformat", "a.xyz"), Some(Family::Ply));
        assert_eq!(detect(b"# .PCD v0.7", "a"), Some(Family::Pcd));
        assert_eq!(detect(b"1 2 3", "scan.PLY"), Some(Family::Ply));
        assert_eq!(detect(b"1 2 3", "scan.TXT"), Some(Family::Text));
        assert_eq!(detect(b"", "0000.bin"), Some(Family::Kitti));
        assert_eq!(detect(b"1 2 3", "scan.las"), None);
        assert_eq!(detect(b"1 2 3", "scan"), None);
    }
}
