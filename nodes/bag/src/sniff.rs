//! File type detection by the first bytes.

use std::{fs::File, io::Read, path::Path};

use super::{BagError, ros1::ROS1_MAGIC};

/// Magic at both ends of an MCAP file.
pub(crate) const MCAP_MAGIC: &[u8] = mcap::MAGIC;
/// Magic of a zstd frame.
pub(crate) const ZSTD_MAGIC: &[u8] = &[0x28, 0xb5, 0x2f, 0xfd];
/// Magic of an SQLite database.
pub(crate) const SQLITE_MAGIC: &[u8] = b"SQLite format 3\0";

/// Types of storage files.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum FileKind {
    Mcap,
    Sqlite3,
    Ros1,
    Zstd,
}

const NO_BAG: &str = "give a rosbag2 folder, an .mcap or .db3 file of one, or a .bag file of ROS 1";
const CAPTURE: &str = "replay it through the sensor's ROS 2 driver and record that";
const METADATA: &str = "give the folder that holds it";

/// File types that are mistaken for a bag: first bytes, name, remedy.
const FOREIGN: &[(&[u8], &str, &str)] = &[
    (b"\x89PNG", "a PNG image", NO_BAG),
    (b"\xff\xd8\xff", "a JPEG image", NO_BAG),
    (b"%PDF", "a PDF document", NO_BAG),
    (
        b"\x04\x22\x4d\x18",
        "an lz4 archive",
        "unpack it with `lz4 -d`",
    ),
    (b"\x1f\x8b", "a gzip archive", "unpack it with `gunzip`"),
    (b"BZh", "a bzip2 archive", "unpack it with `bunzip2`"),
    (b"\xfd7zXZ\0", "an xz archive", "unpack it with `unxz`"),
    (b"PK\x03\x04", "a zip archive", "unpack it"),
    (b"\x7fELF", "a program", NO_BAG),
    (b"\xd4\xc3\xb2\xa1", "a packet capture (pcap)", CAPTURE),
    (b"\n\r\r\n", "a packet capture (pcapng)", CAPTURE),
    (b"\x89HDF", "an HDF5 file", NO_BAG),
    (
        b"rosbag2_bagfile_information",
        "the metadata of a bag",
        METADATA,
    ),
    (b"# .PCD", "a PCD point cloud", NO_BAG),
    (b"ply\n", "a PLY file", NO_BAG),
];

/// Identifies the file at `path`, or names its actual type in the error.
///
/// Unknown first bytes may be damaged; then the extension decides.
pub(crate) fn identify(path: &Path) -> Result<FileKind, BagError> {
    let mut head = Vec::new();
    let file = File::open(path).map_err(BagError::io(path, "open"))?;
    file.take(64)
        .read_to_end(&mut head)
        .map_err(BagError::io(path, "read"))?;
    let name = path.to_string_lossy();
    let named = match &*name {
        name if name.ends_with(".mcap") => Some(FileKind::Mcap),
        name if name.ends_with(".db3") => Some(FileKind::Sqlite3),
        name if is_ros1(name) => Some(FileKind::Ros1),
        _ => None,
    };
    if let Some(kind) = named.filter(|_| is_unknown(&head)) {
        return Ok(kind);
    }
    identify_bytes(&head).map_err(|(found, remedy)| match found.as_str() {
        "cut" => BagError::Truncated {
            path: path.to_path_buf(),
            size_bytes: head.len() as u64,
            inside: "the file's magic at byte 0".into(),
            readable_messages: 0,
        },
        _ => BagError::Foreign {
            path: path.to_path_buf(),
            found,
            remedy,
        },
    })
}

/// True for the name of a ROS 1 bag, finished or not.
pub(crate) fn is_ros1(name: &str) -> bool {
    name.ends_with(".bag") || name.ends_with(".bag.active")
}

/// True for bytes that start neither a known file type nor a text.
fn is_unknown(head: &[u8]) -> bool {
    let kinds = [MCAP_MAGIC, SQLITE_MAGIC, ROS1_MAGIC, ZSTD_MAGIC].into_iter();
    let is_kind = |magic: &[u8]| head.starts_with(magic) || magic.starts_with(head);
    !kinds.chain(FOREIGN.iter().map(|f| f.0)).any(is_kind)
        && !head
            .iter()
            .all(|b| b.is_ascii_graphic() || b.is_ascii_whitespace())
}

fn identify_bytes(head: &[u8]) -> Result<FileKind, (String, &'static str)> {
    let kinds = [
        (MCAP_MAGIC, FileKind::Mcap),
        (SQLITE_MAGIC, FileKind::Sqlite3),
        (ROS1_MAGIC, FileKind::Ros1),
        (ZSTD_MAGIC, FileKind::Zstd),
    ];
    if let Some((_, kind)) = kinds.iter().find(|(magic, _)| head.starts_with(magic)) {
        return Ok(*kind);
    }
    let is_text = |b: &u8| b.is_ascii_graphic() || b.is_ascii_whitespace();
    let (found, remedy) = if head.is_empty() {
        let remedy = "the recorder wrote nothing; record again";
        ("empty (0 bytes)", remedy)
    } else if kinds.iter().any(|(magic, _)| magic.starts_with(head)) {
        ("cut", "")
    } else if let Some((_, found, remedy)) = FOREIGN.iter().find(|f| head.starts_with(f.0)) {
        (*found, *remedy)
    } else if head.iter().all(|&b| b == 0) {
        let remedy = "the recorder's machine crashed; take another copy";
        ("filled with zeros", remedy)
    } else {
        let shown: Vec<String> = head.iter().take(8).map(|b| format!("{b:02x}")).collect();
        let kind = match head.iter().all(is_text) {
            true => "a text file",
            false => "of unknown kind",
        };
        let found = format!("{kind} (first bytes {})", shown.join(" "));
        return Err((found, NO_BAG));
    };
    Err((found.to_owned(), remedy))
}

/// True for an SQLite file, compressed or not.
pub(crate) fn is_sqlite(path: &Path) -> bool {
    let named = path.to_string_lossy().contains(".db3");
    identify(path).map_or(named, |kind| match kind {
        FileKind::Sqlite3 => true,
        FileKind::Mcap | FileKind::Ros1 => false,
        FileKind::Zstd => named,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn foreign_files_are_named() {
        for (bytes, expected) in [
            (&b"\x89PNG\r\n\x1a\n"[..], "a PNG image"),
            (b"", "empty"),
            (b"hello world\n", "a text file"),
            (b"\0\0\0\0\0", "zeros"),
            (b"\x89MC", "cut"),
            (b"\x01\x02\x03", "first bytes 01 02 03"),
        ] {
            let (found, _) = identify_bytes(bytes).unwrap_err();
            assert!(found.contains(expected), "{found}");
        }
    }
}
