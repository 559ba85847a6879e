//! Bytes of a map file with their position and checksums.

use std::io::{self, Read};
use std::ops::Range;

use super::FileError;
use super::head::{
    END_TAG, HEAD_BYTES, Head, MAGIC, OLD_MAGIC, SECTION_HEAD_BYTES, SECTION_TAG, SectionHead,
    corrupt,
};

/// Bytes of a section read at once.
const PART_BYTES: u64 = 1 << 20;

/// Reader that tracks the position and the checksum.
pub(super) struct Source<R> {
    reader: R,
    crc: crc32fast::Hasher,
    position: u64,
}

impl<R: Read> Source<R> {
    pub(super) fn new(reader: R) -> Source<R> {
        Source {
            reader,
            crc: crc32fast::Hasher::new(),
            position: 0,
        }
    }

    pub(super) fn position(&self) -> u64 {
        self.position
    }

    /// Fills the buffer as far as data are available.
    fn fill(&mut self, buffer: &mut [u8], part: &str) -> Result<(), FileError> {
        let mut filled = 0;
        while let Some(rest) = buffer.get_mut(filled..).filter(|rest| !rest.is_empty()) {
            match self.reader.read(rest) {
                Ok(0) => {
                    return Err(FileError::Truncated {
                        position: self.position,
                        part: part.to_owned(),
                    });
                }
                Ok(bytes) => {
                    filled += bytes;
                    self.position += bytes as u64;
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(source) => {
                    return Err(FileError::Io {
                        position: self.position,
                        source,
                    });
                }
            }
        }
        Ok(())
    }

    /// Reads bytes whose last four are the checksum of the others; returns these.
    fn summed<const N: usize>(&mut self, begin: &[u8], part: &str) -> Result<Vec<u8>, FileError> {
        let start = self.position - begin.len() as u64;
        let mut bytes = vec![0; N - begin.len() - 4];
        self.fill(&mut bytes, part)?;
        let mut crc = crc32fast::Hasher::new();
        crc.update(begin);
        crc.update(&bytes);
        self.crc.combine(&crc);
        let end = self.position;
        let saved = self.crc_value(part)?;
        verify(start..end, part, saved, crc.finalize())?;
        self.crc.update(&saved.to_le_bytes());
        Ok(bytes)
    }

    fn crc_value(&mut self, part: &str) -> Result<u32, FileError> {
        let mut saved = [0; 4];
        self.fill(&mut saved, part)?;
        Ok(u32::from_le_bytes(saved))
    }

    pub(super) fn head(&mut self) -> Result<Head, FileError> {
        let mut magic = [0; 8];
        self.fill(&mut magic, "head")?;
        if magic == *OLD_MAGIC {
            return Err(FileError::OldVersion);
        }
        if magic != *MAGIC {
            return Err(FileError::Magic { found: magic });
        }
        Head::from_bytes(&self.summed::<HEAD_BYTES>(&magic, "head")?)
    }

    pub(super) fn section_head(&mut self) -> Result<SectionHead, FileError> {
        let start = self.position;
        let mut tag = [0; 4];
        self.fill(&mut tag, "head of a section")?;
        if tag != *SECTION_TAG {
            return Err(corrupt(start, "expected the start of a section".to_owned()));
        }
        let bytes = self.summed::<SECTION_HEAD_BYTES>(&tag, "head of a section")?;
        SectionHead::from_bytes(&bytes, start)
    }

    /// Stored bytes of a section, with a verified checksum.
    pub(super) fn stored(&mut self, section: &SectionHead) -> Result<Vec<u8>, FileError> {
        // Grows with the data, whatever size the head declares.
        let mut bytes = Vec::new();
        self.each_part(section, |part| bytes.extend_from_slice(part))?;
        Ok(bytes)
    }

    /// Skips a section, in constant memory.
    pub(super) fn skip(&mut self, section: &SectionHead) -> Result<(), FileError> {
        self.each_part(section, |_| {})
    }

    /// Passes the stored bytes of a section in parts; fails at the end if they are damaged.
    fn each_part(
        &mut self,
        section: &SectionHead,
        mut take: impl FnMut(&[u8]),
    ) -> Result<(), FileError> {
        let (start, name) = (self.position, format!("section {}", section.name));
        let mut crc = crc32fast::Hasher::new();
        let mut buffer = vec![0; section.stored_bytes.min(PART_BYTES) as usize];
        let mut wanted = section.stored_bytes;
        while wanted > 0 {
            let step = wanted.min(PART_BYTES);
            let part = buffer.get_mut(..step as usize).unwrap_or_default();
            self.fill(part, &name)?;
            crc.update(part);
            take(part);
            wanted -= step;
        }
        self.crc.combine(&crc);
        verify(start..self.position, &name, section.crc, crc.finalize())
    }

    /// Reads and verifies the end marker, its checksum and the end.
    pub(super) fn finish(&mut self) -> Result<(), FileError> {
        let start = self.position;
        let mut tag = [0; 4];
        self.fill(&mut tag, "end marker")?;
        if tag != *END_TAG {
            return Err(corrupt(start, "expected the end marker".to_owned()));
        }
        self.crc.update(&tag);
        let end = self.position;
        let saved = self.crc_value("end marker")?;
        verify(0..end, "whole file", saved, self.crc.clone().finalize())?;
        let position = self.position;
        match self.fill(&mut [0], "end marker") {
            Err(FileError::Truncated { .. }) => Ok(()),
            Err(error) => Err(error),
            Ok(()) => Err(FileError::TrailingBytes { position }),
        }
    }
}

fn verify(range: Range<u64>, part: &str, saved: u32, calculated: u32) -> Result<(), FileError> {
    if saved == calculated {
        return Ok(());
    }
    Err(FileError::Checksum {
        start: range.start,
        end: range.end,
        part: part.to_owned(),
        saved,
        calculated,
    })
}
