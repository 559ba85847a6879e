//! Writing a map: head, sections, end.

use std::io::Write;

use super::column_values::{encode_colors, encode_labels, encode_stamps};
use super::head::{
    COLOR, COUNT, Codec, Column, END_TAG, Head, KEYS, LABELS, OFFSET_SUM, STAMPS, SectionHead,
};
use super::lattice_figures::orientation_error;
use super::options::{MAX_EXPANSION, WriteOptions};
use super::{FileError, MapContents};
use crate::voxels::codec::{encode_keys, push_varint, zigzag};

impl MapContents {
    /// Writes the map; equal maps give equal bytes for the same options.
    pub fn write(&self, writer: impl Write, options: &WriteOptions) -> Result<(), FileError> {
        let level = options.zstd_level;
        if let Some(level) = level.filter(|level| !(1..=19).contains(level)) {
            return Err(FileError::Level(level));
        }
        if let Some(reason) = orientation_error(&self.lattice.orientation()) {
            return Err(FileError::Lattice(reason));
        }
        let voxels = self.voxels.as_ref().filter(|_| !options.occupancy_only);
        let payload = self.columns.payload();
        let further = [payload.stamps, payload.labels, payload.color];
        let further: u32 = further.into_iter().map(u32::from).sum();
        let head = Head {
            lattice: self.lattice.clone(),
            datum_index: self.datum_index,
            sums: self.sums,
            voxels: self.keys.len() as u64,
            sections: if voxels.is_some() { 3 + further } else { 1 },
        };
        let mut sink = Sink {
            writer,
            crc: crc32fast::Hasher::new(),
            position: 0,
        };
        sink.write(&head.to_bytes())?;
        sink.section(&KEYS, encode_keys(&self.keys), level)?;
        if let Some(voxels) = voxels {
            let mut bytes = Vec::with_capacity(voxels.len());
            voxels
                .iter()
                .for_each(|voxel| push_varint(&mut bytes, u64::from(voxel.count)));
            sink.section(&COUNT, bytes, level)?;
            let mut bytes = Vec::with_capacity(voxels.len().saturating_mul(8));
            voxels
                .iter()
                .flat_map(|voxel| voxel.sum)
                .for_each(|sum| push_varint(&mut bytes, zigzag(sum)));
            sink.section(&OFFSET_SUM, bytes, level)?;
            if payload.stamps {
                sink.section(&STAMPS, encode_stamps(&self.columns), level)?;
            }
            if payload.labels {
                sink.section(&LABELS, encode_labels(&self.columns), level)?;
            }
            if payload.color {
                sink.section(&COLOR, encode_colors(&self.columns), level)?;
            }
        }
        sink.write(END_TAG)?;
        let crc = sink.crc.clone().finalize();
        sink.write(&crc.to_le_bytes())?;
        sink.writer.flush().map_err(|source| FileError::Io {
            position: sink.position,
            source,
        })
    }
}

struct Sink<W> {
    writer: W,
    crc: crc32fast::Hasher,
    position: u64,
}

impl<W: Write> Sink<W> {
    fn write(&mut self, bytes: &[u8]) -> Result<(), FileError> {
        self.crc.update(bytes);
        self.write_summed(bytes)
    }

    /// Writes bytes already in the checksum.
    fn write_summed(&mut self, bytes: &[u8]) -> Result<(), FileError> {
        self.writer
            .write_all(bytes)
            .map_err(|source| FileError::Io {
                position: self.position,
                source,
            })?;
        self.position += bytes.len() as u64;
        Ok(())
    }

    fn section(
        &mut self,
        column: &Column,
        raw: Vec<u8>,
        level: Option<i32>,
    ) -> Result<(), FileError> {
        let raw_bytes = raw.len() as u64;
        let packed = match level {
            Some(level) => self.compress(&raw, level)?,
            None => None,
        };
        let (codec, stored) = match packed {
            Some(packed) => (Codec::Zstd, packed),
            None => (Codec::Raw, raw),
        };
        let mut crc = crc32fast::Hasher::new();
        crc.update(&stored);
        let head = SectionHead {
            name: column.name.to_owned(),
            encoding: column.encoding as u8,
            components: column.components,
            codec: codec as u8,
            raw_bytes,
            stored_bytes: stored.len() as u64,
            crc: crc.clone().finalize(),
        };
        self.write(&head.to_bytes())?;
        self.crc.combine(&crc);
        self.write_summed(&stored)
    }

    /// Compresses a section; `None` if it gets no smaller, or smaller than readers accept.
    fn compress(&self, raw: &[u8], level: i32) -> Result<Option<Vec<u8>>, FileError> {
        let packed = zstd::bulk::compress(raw, level).map_err(|source| FileError::Io {
            position: self.position,
            source,
        })?;
        let smaller = packed.len() < raw.len();
        let believed = raw.len() as u64 <= MAX_EXPANSION.saturating_mul(packed.len() as u64);
        Ok((smaller && believed).then_some(packed))
    }
}
