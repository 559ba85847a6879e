//! Label names in a map file: an additional section, which other readers skip.
//!
//! Specified in `docs/map_file.md`.

use std::collections::BTreeMap;
use std::io::{self, Read, Seek, SeekFrom, Write};

use super::file::{FileError, MapContents, WriteOptions};

/// Label names by label.
pub type LabelNames = BTreeMap<u16, String>;

/// Maximum size of a name, bytes of UTF-8.
const MAX_NAME_BYTES: usize = 256;
/// Maximum size of the section: all labels with the longest names.
const MAX_SECTION_BYTES: u64 = (1 << 16) * (4 + MAX_NAME_BYTES as u64);
const SECTION: &[u8; 16] = b"label_names\0\0\0\0\0";
const SECTION_TAG: &[u8; 4] = b"SECT";
const END_TAG: &[u8; 4] = b"LEND";
/// Encoding that no column has: names are not values of voxels.
const ENCODING: u8 = 5;
/// Size of the file head, bytes; position of its number of sections; of its checksum.
const HEAD_BYTES: usize = 224;
const SECTIONS_AT: usize = 216;
const HEAD_CRC_AT: usize = 220;
/// Size of a section head, bytes.
const SECTION_HEAD_BYTES: usize = 48;
/// Size of the end marker and the checksum of the file.
const END_BYTES: usize = 8;

/// Writes a map with its label names; without names, as [`MapContents::write`] does.
pub fn write_named(
    map: &MapContents,
    names: &LabelNames,
    writer: impl Write,
    options: &WriteOptions,
) -> Result<(), FileError> {
    if names.is_empty() {
        return map.write(writer, options);
    }
    let mut appended = Appended {
        writer,
        section: section(names),
        head: Vec::with_capacity(HEAD_BYTES),
        held: Vec::new(),
        crc: crc32fast::Hasher::new(),
        position: 0,
    };
    map.write(&mut appended, options)?;
    let position = appended.position;
    appended
        .finish()
        .map_err(|source| FileError::Io { position, source })
}

/// Reads the label names; empty if the file has none. The rest of the file is not validated.
pub fn read_label_names(mut file: impl Read + Seek) -> Result<LabelNames, FileError> {
    let mut position = HEAD_BYTES as u64;
    let head = bytes::<HEAD_BYTES>(&mut file, 0, "head")?;
    let sections = u32_at(&head, SECTIONS_AT);
    for _ in 0..sections {
        let head = bytes::<SECTION_HEAD_BYTES>(&mut file, position, "head of a section")?;
        position += SECTION_HEAD_BYTES as u64;
        let corrupt = |reason: String| FileError::Corrupt { position, reason };
        let (summed, crc) = head.split_at(SECTION_HEAD_BYTES - 4);
        if !head.starts_with(SECTION_TAG) || crc32fast::hash(summed) != u32_at(crc, 0) {
            return Err(corrupt("expected the start of a section".to_owned()));
        }
        let stored = u64_at(&head, 32);
        if head.get(4..20) != Some(SECTION.as_slice()) {
            position = position.saturating_add(stored);
            let moved = file.seek(SeekFrom::Start(position));
            moved.map_err(|source| FileError::Io { position, source })?;
            continue;
        }
        if stored > MAX_SECTION_BYTES || head.get(20..24) != Some(&[ENCODING, 0, 0, 0]) {
            return Err(corrupt(format!(
                "section label_names of {stored} bytes is not one of version 2"
            )));
        }
        let mut data = Vec::new();
        let read = file.by_ref().take(stored).read_to_end(&mut data);
        read.map_err(|source| FileError::Io { position, source })?;
        if data.len() as u64 != stored || crc32fast::hash(&data) != u32_at(&head, 40) {
            return Err(corrupt(
                "section label_names has another checksum".to_owned(),
            ));
        }
        return names_of(&data).ok_or_else(|| {
            corrupt("section label_names: labels ascend, and names are UTF-8".to_owned())
        });
    }
    Ok(LabelNames::new())
}

/// Longest prefix of a name that fits, in whole characters.
pub fn short_name(name: &str) -> &str {
    let end = (0..=MAX_NAME_BYTES.min(name.len())).rev();
    let end = { end }.find(|end| name.is_char_boundary(*end));
    name.get(..end.unwrap_or(0)).unwrap_or_default()
}

/// Head and bytes of the section.
fn section(names: &LabelNames) -> Vec<u8> {
    let mut data = Vec::new();
    for (label, name) in names {
        let name = short_name(name);
        data.extend(label.to_le_bytes());
        data.extend((name.len() as u16).to_le_bytes());
        data.extend(name.as_bytes());
    }
    let mut section = Vec::with_capacity(SECTION_HEAD_BYTES + data.len());
    section.extend(SECTION_TAG);
    section.extend(SECTION);
    section.extend([ENCODING, 0, 0, 0]);
    for _ in ["encoded", "stored"] {
        section.extend((data.len() as u64).to_le_bytes());
    }
    section.extend(crc32fast::hash(&data).to_le_bytes());
    section.extend(crc32fast::hash(&section).to_le_bytes());
    section.extend(data);
    section
}

fn names_of(mut data: &[u8]) -> Option<LabelNames> {
    let mut names = LabelNames::new();
    while !data.is_empty() {
        let (label, rest) = data.split_first_chunk()?;
        let (length, rest) = rest.split_first_chunk()?;
        let (label, length) = (u16::from_le_bytes(*label), u16::from_le_bytes(*length));
        let (name, rest) = rest.split_at_checked(usize::from(length))?;
        if names
            .last_key_value()
            .is_some_and(|(last, _)| *last >= label)
        {
            return None;
        }
        names.insert(label, std::str::from_utf8(name).ok()?.to_owned());
        data = rest;
    }
    Some(names)
}

fn bytes<const N: usize>(
    file: &mut impl Read,
    position: u64,
    part: &str,
) -> Result<[u8; N], FileError> {
    let mut bytes = [0; N];
    file.read_exact(&mut bytes)
        .map_err(|source| match source.kind() {
            io::ErrorKind::UnexpectedEof => FileError::Truncated {
                position,
                part: part.to_owned(),
            },
            _ => FileError::Io { position, source },
        })?;
    Ok(bytes)
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    let four = bytes.get(at..).and_then(|rest| rest.first_chunk());
    four.map_or(0, |four| u32::from_le_bytes(*four))
}

fn u64_at(bytes: &[u8], at: usize) -> u64 {
    let eight = bytes.get(at..).and_then(|rest| rest.first_chunk());
    eight.map_or(0, |eight| u64::from_le_bytes(*eight))
}

/// Writer that inserts a section before the end of a map file.
struct Appended<W> {
    writer: W,
    section: Vec<u8>,
    /// Head, until it is complete.
    head: Vec<u8>,
    /// Last bytes, which may be the end.
    held: Vec<u8>,
    crc: crc32fast::Hasher,
    position: u64,
}

impl<W: Write> Appended<W> {
    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.crc.update(bytes);
        self.writer.write_all(bytes)?;
        self.position += bytes.len() as u64;
        Ok(())
    }

    /// Head with one more section.
    fn put_head(&mut self) -> io::Result<()> {
        let mut head = std::mem::take(&mut self.head);
        let sections = u32_at(&head, SECTIONS_AT).saturating_add(1);
        head.truncate(SECTIONS_AT);
        head.extend(sections.to_le_bytes());
        debug_assert_eq!(head.len(), HEAD_CRC_AT);
        head.extend(crc32fast::hash(&head).to_le_bytes());
        self.put(&head)
    }

    fn finish(mut self) -> io::Result<()> {
        if !self.held.starts_with(END_TAG) {
            return Err(io::Error::other("the map has no end marker"));
        }
        let mut end = std::mem::take(&mut self.section);
        end.extend(END_TAG);
        self.put(&end)?;
        let crc = self.crc.clone().finalize();
        self.writer.write_all(&crc.to_le_bytes())?;
        self.writer.flush()
    }
}

impl<W: Write> Write for Appended<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut rest = bytes;
        if self.position == 0 {
            let missing = HEAD_BYTES.saturating_sub(self.head.len());
            let (head, behind) = rest.split_at(missing.min(rest.len()));
            self.head.extend(head);
            if self.head.len() < HEAD_BYTES {
                return Ok(bytes.len());
            }
            self.put_head()?;
            rest = behind;
        }
        let mut held = std::mem::take(&mut self.held);
        held.extend(rest);
        let passed = held.len().saturating_sub(END_BYTES);
        let (pass, keep) = held.split_at(passed);
        self.put(pass)?;
        self.held = keep.to_vec();
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use nalgebra::Vector3;

    use super::*;
    use crate::cloud::Cloud;
    use crate::lattice::{Lattice, LatticeKind};
    use crate::voxels::VoxelList;

    fn map() -> MapContents {
        let lattice = Lattice::new(LatticeKind::Fcc, 0.1).unwrap();
        let mut list = VoxelList::new(lattice, Vector3::zeros(), 100).unwrap();
        let points: Vec<_> = (0..20)
            .map(|i| Vector3::new(f64::from(i), 1.0, 0.3))
            .collect();
        list.insert(&Cloud::from_points(5, Vector3::zeros(), &points));
        MapContents::from_list(&list)
    }

    fn names() -> LabelNames {
        [(0, "wall"), (7, "Tür"), (65_534, "")]
            .map(|(label, name)| (label, name.to_owned()))
            .into()
    }

    fn written(names: &LabelNames, options: &WriteOptions) -> Vec<u8> {
        let mut bytes = Vec::new();
        write_named(&map(), names, &mut bytes, options).unwrap();
        bytes
    }

    #[test]
    fn names_are_read_back_and_readers_of_maps_skip_them() {
        for options in [
            WriteOptions::default(),
            WriteOptions {
                zstd_level: Some(3),
                ..WriteOptions::default()
            },
            WriteOptions {
                occupancy_only: true,
                ..WriteOptions::default()
            },
        ] {
            let with = written(&names(), &options);
            assert_eq!(read_label_names(Cursor::new(&with)).unwrap(), names());
            let without = written(&LabelNames::new(), &options);
            assert!(read_label_names(Cursor::new(&without)).unwrap().is_empty());
            let read = |bytes: &[u8]| MapContents::read(bytes, 100).unwrap();
            assert_eq!(read(&with), read(&without));
            assert!(with.len() > without.len());
        }
    }

    #[test]
    fn long_names_end_at_a_character() {
        let long = "ö".repeat(200);
        let names = LabelNames::from([(1, long.clone())]);
        let bytes = written(&names, &WriteOptions::default());
        let read = read_label_names(Cursor::new(bytes)).unwrap();
        assert_eq!(read[&1], long[..MAX_NAME_BYTES]);
        assert_eq!(short_name("ö"), "ö");
        let odd = format!("a{long}");
        assert_eq!(short_name(&odd).len(), MAX_NAME_BYTES - 1);
    }

    #[test]
    fn damage_is_an_error_and_never_a_wrong_name() {
        let good = written(&names(), &WriteOptions::default());
        let section = good
            .windows(SECTION.len())
            .position(|bytes| bytes == SECTION)
            .unwrap()
            - 4;
        for at in section..good.len() - END_BYTES {
            let mut bad = good.clone();
            bad[at] ^= 0x21;
            let read = read_label_names(Cursor::new(&bad));
            assert!(read.is_err(), "byte {at}: {read:?}");
        }
        for length in 0..good.len() - END_BYTES {
            let cut = read_label_names(Cursor::new(&good[..length]));
            assert!(cut.is_err(), "{length} bytes");
        }
    }
}
