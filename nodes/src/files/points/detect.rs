//! Detection of the format of a point file, by content and extension.

use std::path::Path;

use super::error::PointFileError;
use super::{las, octree};

/// Formats with a common reader.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Family {
    Ply,
    Pcd,
    Text,
    Kitti,
    Las,
    E57,
    Octree,
}

/// Families by extension.
const EXTENSIONS: [(&str, Family); 12] = [
    ("ply", Family::Ply),
    ("pcd", Family::Pcd),
    ("xyz", Family::Text),
    ("txt", Family::Text),
    ("asc", Family::Text),
    ("csv", Family::Text),
    ("bin", Family::Kitti),
    ("las", Family::Las),
    ("laz", Family::Las),
    ("e57", Family::E57),
    ("bt", Family::Octree),
    ("ot", Family::Octree),
];

/// True for the extension of a point file, compressed or not.
pub fn is_named_as_points(path: &Path) -> bool {
    let packed = path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("bz2"));
    match packed {
        true => by_name(&path.with_extension("")).is_some(),
        false => by_name(path).is_some(),
    }
}

fn by_name(path: &Path) -> Option<Family> {
    let extension = path.extension()?;
    let mut known = EXTENSIONS.iter();
    let found = known.find(|(known, _)| extension.eq_ignore_ascii_case(known));
    found.map(|(_, family)| *family)
}

/// True for the start of a bzip2 stream with a block.
pub(super) fn is_bzip2(start: &[u8]) -> bool {
    let block = start.get(4..10) == Some(&[0x31, 0x41, 0x59, 0x26, 0x53, 0x59]);
    start.starts_with(b"BZh") && block
}

/// Length of a bzip2 stream that is truncated before its first block.
pub(super) fn cut_bzip2(start: &[u8]) -> Option<u64> {
    const HEAD: [u8; 10] = *b"BZh91AY&SY";
    let is_start = match start {
        [b'B', b'Z', b'h', b'1'..=b'9', rest @ ..] => HEAD.get(4..)?.starts_with(rest),
        _ => false,
    };
    is_start.then_some(start.len() as u64)
}

/// Detects the family by the first bytes, else by the extension.
pub(super) fn detect(start: &[u8], name: &Path) -> Result<Family, PointFileError> {
    if start.starts_with(b"ply\n") || start.starts_with(b"ply\r") {
        return Ok(Family::Ply);
    }
    if start.starts_with(b"# .PCD") || start.starts_with(b"VERSION ") {
        return Ok(Family::Pcd);
    }
    if start.starts_with(las::SIGNATURE) {
        return Ok(Family::Las);
    }
    if start.starts_with(b"ASTM-E57") {
        return Ok(Family::E57);
    }
    if start.starts_with(octree::SIGNATURE) || start.starts_with(octree::FULL_SIGNATURE) {
        return Ok(Family::Octree);
    }
    by_name(name).ok_or_else(|| {
        let extension = name.extension().unwrap_or_default().to_string_lossy();
        PointFileError::UnknownFormat {
            extension: extension.into_owned(),
        }
    })
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
        assert_eq!(detect(b"LASF\x01", "scan.xyz"), Some(Family::Las));
        assert_eq!(detect(b"", "scan.laz"), Some(Family::Las));
        assert_eq!(detect(b"ASTM-E57", "scan"), Some(Family::E57));
        assert_eq!(detect(octree::SIGNATURE, "map"), Some(Family::Octree));
        assert_eq!(detect(octree::FULL_SIGNATURE, "map"), Some(Family::Octree));
        assert_eq!(detect(b"1 2 3", "scan.step"), None);
        assert_eq!(detect(b"1 2 3", "scan"), None);
    }

    #[test]
    fn point_files_are_known_by_their_names() {
        for name in ["a.ply", "a.PCD", "a.b.laz", "a.xyz.bz2", "a.bt", "a.ot"] {
            assert!(is_named_as_points(Path::new(name)), "{name}");
        }
        for name in ["a", "map.lattice", "a.bz2", "a.ply.zip", "ply"] {
            assert!(!is_named_as_points(Path::new(name)), "{name}");
        }
    }
}
