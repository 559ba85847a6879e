//! Fixed heads of a map file and of a section, and the end of the file.

use super::{Figure, FileError, LatticeFigures};
use crate::lattice::Lattice;
use crate::voxels::distortion::DistortionSums;

pub(super) const MAGIC: &[u8; 8] = b"LATTICE2";
pub(super) const OLD_MAGIC: &[u8; 8] = b"LATTICE1";
pub(super) const SECTION_TAG: &[u8; 4] = b"SECT";
pub(super) const END_TAG: &[u8; 4] = b"LEND";
/// Size of the file head with its checksum, bytes.
pub(super) const HEAD_BYTES: usize = 224;
/// Size of a section head with its checksum, bytes.
pub(super) const SECTION_HEAD_BYTES: usize = 48;

const VOLUME_AT: u64 = 24;
const ORIENTATION_AT: u64 = 32;
const GENERATOR_AT: u64 = 64;

/// Head of a map file: lattice, datum, counts.
pub(super) struct Head {
    pub(super) lattice: Lattice,
    pub(super) datum_index: [i64; 3],
    pub(super) sums: DistortionSums,
    pub(super) voxels: u64,
    pub(super) sections: u32,
}

impl Head {
    pub(super) fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(HEAD_BYTES);
        bytes.extend(MAGIC);
        let figures = LatticeFigures::from(&self.lattice);
        bytes.extend(name16(figures.kind.name()));
        bytes.extend(figures.cell_volume_m3.to_le_bytes());
        for value in figures.orientation.iter().chain(&figures.generator_m) {
            bytes.extend(value.to_le_bytes());
        }
        self.datum_index
            .iter()
            .for_each(|i| bytes.extend(i.to_le_bytes()));
        bytes.extend(self.sums.points.to_le_bytes());
        bytes.extend(self.sums.squares.to_le_bytes());
        bytes.extend(self.sums.distances.to_le_bytes());
        bytes.extend(self.sums.largest_square.to_le_bytes());
        bytes.extend(self.voxels.to_le_bytes());
        bytes.extend(self.sections.to_le_bytes());
        bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
        bytes
    }

    /// Reads the fields after the magic, without the checksum; the datum is not validated.
    pub(super) fn from_bytes(bytes: &[u8]) -> Result<Head, FileError> {
        let mut fields = Fields {
            bytes,
            position: MAGIC.len() as u64,
        };
        let at = fields.position;
        let name = name_of(&fields.array::<16>()).map_err(|reason| corrupt(at, reason))?;
        let figures = LatticeFigures {
            kind: LatticeFigures::kind_of(&name).map_err(|reason| corrupt(at, reason))?,
            cell_volume_m3: fields.f64(),
            orientation: std::array::from_fn(|_| fields.f64()),
            generator_m: std::array::from_fn(|_| fields.f64()),
        };
        let lattice = figures.lattice().map_err(|error| {
            let at = match error.figure {
                Figure::Volume => VOLUME_AT,
                Figure::Orientation => ORIENTATION_AT,
                Figure::Generator => GENERATOR_AT,
            };
            corrupt(at, error.to_string())
        })?;
        let datum_index = std::array::from_fn(|_| i64::from_le_bytes(fields.array()));
        let sums = DistortionSums {
            points: fields.u64(),
            squares: u128::from_le_bytes(fields.array()),
            distances: u128::from_le_bytes(fields.array()),
            largest_square: fields.u64(),
        };
        let (voxels, sections) = (fields.u64(), u32::from_le_bytes(fields.array()));
        Ok(Head {
            lattice,
            datum_index,
            sums,
            voxels,
            sections,
        })
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub(super) enum Encoding {
    /// LEB128 of the difference to the previous value, the first absolute.
    Steps = 0,
    /// LEB128.
    Unsigned = 1,
    /// LEB128 of the zigzag form: 0, -1, 1, -2, ...
    Signed = 2,
    /// As `Signed`, of the difference to the same value of the previous voxel.
    SignedSteps = 3,
    /// As `Unsigned`; a row starts with its number of entries.
    Rows = 4,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub(super) enum Codec {
    Raw = 0,
    Zstd = 1,
}

/// Column: its name and the encoding of its values.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Column {
    pub(super) name: &'static str,
    pub(super) encoding: Encoding,
    /// Values per voxel.
    pub(super) components: u8,
    /// Maximum bytes per value.
    pub(super) longest: u64,
}

impl Column {
    const fn new(name: &'static str, encoding: Encoding, components: u8, longest: u64) -> Column {
        Column {
            name,
            encoding,
            components,
            longest,
        }
    }
}

pub(super) const KEYS: Column = Column::new("keys", Encoding::Steps, 1, 9);
pub(super) const COUNT: Column = Column::new("count", Encoding::Unsigned, 1, 5);
pub(super) const OFFSET_SUM: Column = Column::new("offset_sum", Encoding::Signed, 3, 10);
pub(super) const STAMPS: Column = Column::new("stamps", Encoding::SignedSteps, 2, 10);
/// Maximum: the number of labels, and each label with its count.
pub(super) const LABELS: Column = Column::new("labels", Encoding::Rows, 1, 3 + 65_536 * 8);
/// Number of coloured points, and the sums of red, green and blue, below 2^40.
pub(super) const COLOR: Column = Column::new("color", Encoding::Unsigned, 4, 6);

/// Columns in order: the first is required, the next two come together, the last three are optional.
pub(super) const COLUMNS: [Column; 6] = [KEYS, COUNT, OFFSET_SUM, STAMPS, LABELS, COLOR];

/// Head of a section; columns of later versions have other names, encodings and codecs.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct SectionHead {
    pub(super) name: String,
    pub(super) encoding: u8,
    pub(super) components: u8,
    pub(super) codec: u8,
    pub(super) raw_bytes: u64,
    pub(super) stored_bytes: u64,
    pub(super) crc: u32,
}

impl SectionHead {
    pub(super) fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(SECTION_HEAD_BYTES);
        bytes.extend(SECTION_TAG);
        bytes.extend(name16(&self.name));
        bytes.extend([self.encoding, self.components, self.codec, 0]);
        bytes.extend(self.raw_bytes.to_le_bytes());
        bytes.extend(self.stored_bytes.to_le_bytes());
        bytes.extend(self.crc.to_le_bytes());
        bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
        bytes
    }

    /// Reads the fields after the tag, without the checksum; `start` is the position of the tag.
    pub(super) fn from_bytes(bytes: &[u8], start: u64) -> Result<SectionHead, FileError> {
        let at = start + SECTION_TAG.len() as u64;
        let mut fields = Fields {
            bytes,
            position: at,
        };
        let name = name_of(&fields.array::<16>()).map_err(|reason| corrupt(at, reason))?;
        let [encoding, components, codec, reserved] = fields.array();
        if reserved != 0 {
            return Err(corrupt(
                fields.position - 1,
                "a reserved byte is not zero".into(),
            ));
        }
        Ok(SectionHead {
            name,
            encoding,
            components,
            codec,
            raw_bytes: fields.u64(),
            stored_bytes: fields.u64(),
            crc: u32::from_le_bytes(fields.array()),
        })
    }
}

pub(super) fn corrupt(position: u64, reason: String) -> FileError {
    FileError::Corrupt { position, reason }
}

/// Name padded with zero bytes.
fn name16(name: &str) -> [u8; 16] {
    let mut bytes = [0; 16];
    bytes
        .iter_mut()
        .zip(name.bytes())
        .for_each(|(to, from)| *to = from);
    bytes
}

fn name_of(bytes: &[u8; 16]) -> Result<String, String> {
    let name: String = bytes
        .iter()
        .take_while(|b| **b != 0)
        .map(|b| char::from(*b))
        .collect();
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    if name.is_empty() || !name.chars().all(plain) || name16(&name) != *bytes {
        return Err(format!(
            "{:?} is not a section name",
            bytes.escape_ascii().to_string()
        ));
    }
    Ok(name)
}

/// Reader of fields of known size; zeros beyond the end.
struct Fields<'a> {
    bytes: &'a [u8],
    position: u64,
}

impl Fields<'_> {
    fn array<const N: usize>(&mut self) -> [u8; N] {
        self.position += N as u64;
        let Some((array, rest)) = self.bytes.split_first_chunk() else {
            return [0; N];
        };
        self.bytes = rest;
        *array
    }

    fn u64(&mut self) -> u64 {
        u64::from_le_bytes(self.array())
    }

    fn f64(&mut self) -> f64 {
        f64::from_le_bytes(self.array())
    }
}
