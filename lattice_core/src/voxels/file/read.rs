//! Reading a map: sections in order, each column validated value by value.

use std::io::{self, Read};

use super::column_error::ColumnError;
use super::column_values::{decode_colors, decode_labels, decode_stamps, expect, expect_end};
use super::contents::no_columns;
use super::head::{
    COLUMNS, COUNT, Codec, Column, KEYS, LABELS, OFFSET_SUM, SECTION_HEAD_BYTES, STAMPS,
    SectionHead, corrupt,
};
use super::options::{MAX_EXPANSION, MAX_WINDOW_LOG};
use super::source::Source;
use super::{FileError, MapContents};
use crate::voxels::Voxel;
use crate::voxels::codec::{Varints, decode_keys, unzigzag};
use crate::voxels::store::fixed_point::reach;

impl MapContents {
    /// Reads a map of at most `max_voxels`.
    ///
    /// Columns with unknown names are skipped; anything else that no writer of this format writes is rejected.
    /// Allocates in proportion to the bytes read.
    pub fn read(reader: impl Read, max_voxels: usize) -> Result<MapContents, FileError> {
        Self::read_columns(reader, max_voxels, COLUMNS.len())
    }

    /// As [`MapContents::read`], but skips everything after the keys.
    pub(super) fn read_keys(
        reader: impl Read,
        max_voxels: usize,
    ) -> Result<MapContents, FileError> {
        Self::read_columns(reader, max_voxels, 1)
    }

    /// Reads the first `wanted` of the known columns.
    fn read_columns(
        reader: impl Read,
        max_voxels: usize,
        wanted: usize,
    ) -> Result<MapContents, FileError> {
        let mut source = Source::new(reader);
        let head = source.head()?;
        if head.voxels > max_voxels as u64 {
            return Err(FileError::TooManyVoxels {
                voxels: head.voxels,
                max_voxels,
            });
        }
        let mut contents = MapContents {
            lattice: head.lattice,
            datum_index: head.datum_index,
            keys: Vec::new(),
            voxels: None,
            columns: no_columns(),
            sums: head.sums,
        };
        contents
            .check_datum()
            .map_err(|reason| corrupt(136, reason))?;
        let mut known = 0;
        for number in 0..head.sections {
            let section = source.section_head()?;
            let place = COLUMNS
                .iter()
                .position(|column| column.name == section.name);
            let fits = match place {
                Some(place) => place == known || (place > known && known > 2),
                None => number > 0,
            };
            if !fits {
                return Err(corrupt(
                    source.position() - SECTION_HEAD_BYTES as u64,
                    format!("section {number} is {:?}, out of order", section.name),
                ));
            }
            known = place.map_or(known, |place| place + 1);
            let read = place.filter(|place| *place < wanted);
            let Some(column) = read.and_then(|place| COLUMNS.get(place)) else {
                source.skip(&section)?;
                continue;
            };
            source.column(column, &section, head.voxels, &mut contents)?;
        }
        if known == 0 || known == 2 {
            let missing = if known == 0 { "keys" } else { "offset_sum" };
            return Err(corrupt(
                source.position(),
                format!("section {missing:?} is missing"),
            ));
        }
        contents.check().map_err(|reason| corrupt(160, reason))?;
        source.finish()?;
        Ok(contents)
    }

    fn set_keys(&mut self, bytes: &[u8], voxels: u64) -> Result<(), ColumnError> {
        let max = usize::try_from(voxels).unwrap_or(usize::MAX);
        self.keys = decode_keys(bytes, max)?;
        if self.keys.len() != max {
            let reason = format!("it has {} keys instead of {voxels}", self.keys.len());
            let offset = bytes.len();
            return Err(ColumnError { offset, reason });
        }
        Ok(())
    }

    fn set_counts(&mut self, bytes: &[u8]) -> Result<(), ColumnError> {
        let mut values = Varints::new(bytes);
        let mut voxels = Vec::with_capacity(self.keys.len());
        while let Some(count) = values.next_value()? {
            let Ok(count) = u32::try_from(count) else {
                return Err(values.error(format!("a voxel has {count} points")));
            };
            voxels.push(Voxel { count, sum: [0; 3] });
        }
        if voxels.len() != self.keys.len() {
            return Err(values.error(format!("it has {} values", voxels.len())));
        }
        self.voxels = Some(voxels);
        Ok(())
    }

    fn set_sums(&mut self, bytes: &[u8]) -> Result<(), ColumnError> {
        let mut values = Varints::new(bytes);
        let reach = reach(&self.lattice);
        for voxel in self.voxels.iter_mut().flatten() {
            for sum in &mut voxel.sum {
                *sum = unzigzag(expect(&mut values)?);
            }
            if let Some(reason) = voxel.contradiction(reach) {
                return Err(values.error(reason));
            }
        }
        expect_end(&mut values)
    }
}

impl<R: Read> Source<R> {
    /// Reads a section of a known column into `contents`.
    fn column(
        &mut self,
        column: &Column,
        section: &SectionHead,
        voxels: u64,
        contents: &mut MapContents,
    ) -> Result<(), FileError> {
        let head_at = self.position() - SECTION_HEAD_BYTES as u64;
        let wrong = |reason: String| corrupt(head_at, format!("section {}: {reason}", column.name));
        if (section.encoding, section.components) != (column.encoding as u8, column.components) {
            return Err(wrong(format!(
                "unknown encoding {} of {} components",
                section.encoding, section.components
            )));
        }
        let values = voxels.saturating_mul(u64::from(column.components));
        let longest = values.saturating_mul(column.longest);
        if !(values..=longest).contains(&section.raw_bytes) {
            return Err(wrong(format!(
                "{} bytes do not fit {values} values",
                section.raw_bytes
            )));
        }
        let (raw, stored) = (section.raw_bytes, section.stored_bytes);
        let plausible = match section.codec {
            codec if codec == Codec::Raw as u8 => stored == raw,
            codec if codec == Codec::Zstd as u8 => {
                stored < raw && raw <= stored.saturating_mul(MAX_EXPANSION)
            }
            codec => return Err(wrong(format!("unknown codec {codec}"))),
        };
        if !plausible {
            return Err(wrong(format!(
                "{raw} bytes are not stored in {stored} by codec {}",
                section.codec
            )));
        }
        let start = self.position();
        let mut bytes = self.stored(section)?;
        let packed = section.codec == Codec::Zstd as u8;
        if packed {
            bytes = decompress(&bytes, raw)
                .map_err(|reason| corrupt(start, format!("section {}: {reason}", column.name)))?;
        }
        let done = match *column {
            KEYS => contents.set_keys(&bytes, voxels),
            COUNT => contents.set_counts(&bytes),
            OFFSET_SUM => contents.set_sums(&bytes),
            STAMPS => decode_stamps(&bytes, contents.keys.len())
                .map(|stamps| contents.columns.set_stamps(stamps)),
            LABELS => decode_labels(&bytes, contents.keys.len())
                .map(|labels| contents.columns.set_labels(labels)),
            _ => decode_colors(&bytes, contents.voxels.as_deref().unwrap_or_default())
                .map(|colors| contents.columns.set_colors(colors.into_iter())),
        };
        done.map_err(|ColumnError { offset, reason }| {
            let (place, unpacked) = if packed {
                (start, format!(", unpacked byte {offset}"))
            } else {
                (start + offset as u64, String::new())
            };
            corrupt(
                place,
                format!("section {}{unpacked}: {reason}", column.name),
            )
        })
    }
}

/// One zstd frame of exactly `raw_bytes`.
fn decompress(stored: &[u8], raw_bytes: u64) -> Result<Vec<u8>, String> {
    let unpack = || -> io::Result<(Vec<u8>, usize)> {
        let mut decoder = zstd::stream::read::Decoder::with_buffer(stored)?.single_frame();
        decoder.window_log_max(MAX_WINDOW_LOG)?;
        let mut raw = Vec::new();
        decoder
            .by_ref()
            .take(raw_bytes.saturating_add(1))
            .read_to_end(&mut raw)?;
        Ok((raw, decoder.finish().len()))
    };
    let (raw, left) = unpack().map_err(|error| format!("zstd: {error}"))?;
    if raw.len() as u64 != raw_bytes || left > 0 {
        return Err(format!(
            "the zstd frame does not unpack to exactly {raw_bytes} bytes"
        ));
    }
    Ok(raw)
}
