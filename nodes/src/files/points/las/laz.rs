//! LASzip-compressed points.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use ::laz::laszip::{CompressorType, LazItemType};
use ::laz::{DecompressionSelection, LasZipDecompressor, LazVlr};

use super::header::Header;
use crate::files::points::collect::Collector;
use crate::files::points::{PointFileError, PointFormat};

/// Reads the points of a file from a byte offset.
pub(super) fn read(
    path: &Path,
    points_at: u64,
    header: &Header,
    points: &mut Collector,
) -> Result<(), PointFileError> {
    let fault = |reason: String| PointFileError::Data {
        format: PointFormat::Laz,
        byte: points_at,
        reason,
    };
    let record = header.laszip.as_deref();
    let record = record.ok_or_else(|| fault("the LASzip record is missing".to_owned()))?;
    // The crate does not validate damaged files.
    let unpacked = catch_unwind(AssertUnwindSafe(|| {
        let mut packed = Packed::open(path, points_at, record).map_err(&fault)?;
        let mut bytes = vec![0; usize::from(header.point_bytes)];
        packed.check(header).map_err(&fault)?;
        let mut decoder = packed.decoder().map_err(&fault)?;
        for index in 1..=header.points {
            let unpacked = decoder.decompress_one(&mut bytes);
            unpacked.map_err(|error| match error.kind() {
                io::ErrorKind::UnexpectedEof => PointFileError::Truncated {
                    byte: points_at,
                    part: format!("point {index} of {}, which is packed", header.points),
                },
                _ => fault(format!("point {index} of {}: {error}", header.points)),
            })?;
            header.push(&bytes, points)?;
        }
        Ok(())
    }));
    unpacked.unwrap_or_else(|_| Err(fault("the packed points are damaged".to_owned())))
}

/// Compressed points of a file.
struct Packed {
    file: BufReader<File>,
    length: u64,
    points_at: u64,
    about: LazVlr,
}

impl Packed {
    fn open(path: &Path, points_at: u64, record: &[u8]) -> Result<Packed, String> {
        let about = LazVlr::from_buffer(record);
        let about = about.map_err(|error| format!("the record of LASzip: {error}"))?;
        let file = File::open(path).map_err(|error| error.to_string())?;
        let length = file.metadata().map_err(|error| error.to_string())?.len();
        Ok(Packed {
            file: BufReader::with_capacity(1 << 16, file),
            length,
            points_at,
            about,
        })
    }

    /// Rejects sizes inconsistent with the file before allocating memory.
    fn check(&mut self, header: &Header) -> Result<(), String> {
        let items = self.about.items().iter().map(|item| u32::from(item.size()));
        let (items, point) = (items.sum::<u32>(), u32::from(header.point_bytes));
        if items != point {
            return Err(format!(
                "points of {point} bytes are packed as {items} bytes"
            ));
        }
        let damaged = |error: io::Error| format!("the chunks of the packed points: {error}");
        let kind = header.laszip.as_deref();
        let kind = kind.and_then(|record| record.first_chunk());
        let kind = kind.map_or(0, |kind| u16::from_le_bytes(*kind));
        if kind != CompressorType::PointWise as u16 {
            self.check_table().map_err(damaged)?;
        }
        if kind == CompressorType::LayeredChunked as u16 {
            self.check_layers(header).map_err(damaged)?;
        }
        Ok(())
    }

    /// Checks the chunk table, which has at least one byte per chunk.
    fn check_table(&mut self) -> io::Result<()> {
        self.file.seek(SeekFrom::Start(self.points_at))?;
        let mut table_at = self.number::<8>().map(u64::from_le_bytes)?;
        if !(self.points_at + 1..self.length).contains(&table_at) {
            // Streaming writers append it at the end.
            self.file.seek(SeekFrom::End(-8))?;
            table_at = self.number::<8>().map(u64::from_le_bytes)?;
        }
        if !(self.points_at + 1..self.length).contains(&table_at) {
            return Ok(());
        }
        self.file.seek(SeekFrom::Start(table_at))?;
        let [_version, chunks] = [self.number::<4>()?, self.number::<4>()?];
        let chunks = u64::from(u32::from_le_bytes(chunks));
        match chunks <= self.length {
            true => Ok(()),
            false => Err(lie(format!("{chunks} chunks in {} bytes", self.length))),
        }
    }

    /// Checks the chunks of a layered file: each begins with a point, the number of points and the bytes of each layer.
    fn check_layers(&mut self, header: &Header) -> io::Result<()> {
        let layers = self
            .about
            .items()
            .iter()
            .map(|item| match item.item_type() {
                LazItemType::Point14 => 9,
                LazItemType::RGBNIR14 => 2,
                LazItemType::Byte14(bytes) => u64::from(bytes),
                _ => 1,
            });
        let layers: u64 = layers.sum();
        let mut at = self.points_at.saturating_add(8);
        let mut points = 0_u64;
        while points < header.points {
            self.file.seek(SeekFrom::Start(at))?;
            self.file.seek_relative(header.point_bytes.into())?;
            let count = u32::from_le_bytes(self.number()?);
            let mut bytes = u64::from(header.point_bytes) + 4 + 4 * layers;
            for _ in 0..layers {
                bytes = bytes.saturating_add(u32::from_le_bytes(self.number()?).into());
            }
            at = at.saturating_add(bytes);
            if count == 0 || at > self.length {
                let length = self.length;
                return Err(lie(format!(
                    "one of {count} points ends at {at} of {length} bytes"
                )));
            }
            points = points.saturating_add(count.into());
        }
        Ok(())
    }

    fn number<const N: usize>(&mut self) -> io::Result<[u8; N]> {
        let mut bytes = [0; N];
        self.file.read_exact(&mut bytes)?;
        Ok(bytes)
    }

    /// Decoder of coordinates and classes.
    fn decoder(mut self) -> Result<LasZipDecompressor<'static, BufReader<File>>, String> {
        let begin = SeekFrom::Start(self.points_at);
        self.file.seek(begin).map_err(|error| error.to_string())?;
        let selection = DecompressionSelection::xy_returns_channel()
            .decompress_z()
            .decompress_classification();
        let decoder = LasZipDecompressor::selective(self.file, self.about, selection);
        decoder.map_err(|error| error.to_string())
    }
}

fn lie(reason: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, reason)
}
