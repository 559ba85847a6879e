//! Maps as files.
//!
//! Little endian, in this order:
//!
//! | offset | bytes | what |
//! |---|---|---|
//! | 0 | 8 | `LATTICE1` |
//! | 8 | 8 | name of the lattice, ASCII, filled up with zero bytes |
//! | 16 | 8 | f64: cell volume, m^3 |
//! | 24 | 24 | 3 x i64: index of the datum; the datum is the generator times this, map frame, metres |
//! | 48 | 8 | u64: points in the statistics |
//! | 56 | 16 | u128: sum of squared distances, in 2^-40 m^2 |
//! | 72 | 16 | u128: sum of distances, in 2^-32 m |
//! | 88 | 8 | u64: largest squared distance, in 2^-40 m^2 |
//! | 96 | 8 | u64: number of voxels |
//! | 104 | ... | for each voxel in order of its key five LEB128 varints: difference to the key before (the first: the key), point count, and the three sums of point minus centre in 2^-20 m, zigzag (0, -1, 1, -2, ...) |
//! | end | 4 | u32: CRC-32 (as in zip) of all bytes before |
//!
//! In Python, where `b` is the file; the varints of the voxels come out of one loop:
//!
//! ```python
//! name, volume, *datum = struct.unpack("<8sd3q", b[8:48]); n = struct.unpack("<Q", b[96:104])[0]; v, x, s = [], 0, 0
//! for c in b[104:-4]: x, s = x | (c & 127) << s, s + 7; (c < 128) and (v.append(x), x := 0, s := 0)
//! keys = list(itertools.accumulate(v[0::5])); counts = v[1::5]; sums = [[(z >> 1) ^ -(z & 1) for z in v[i:i + 3]] for i in range(2, 5 * n, 5)]
//! ```

use std::io::{self, Read, Write};

use thiserror::Error;

use super::codec::{NotShortest, Varint, next_key, push_varint, unzigzag, zigzag};
use super::distortion::DistortionSums;
use super::{Voxel, VoxelList};
use crate::lattice::{Key, Lattice, LatticeKind};

const MAGIC: &[u8; 8] = b"LATTICE1";
/// Bytes written or read at once.
const BUFFER: usize = 1 << 16;

/// Why a map was not written or read; positions are bytes from the start.
#[derive(Debug, Error)]
pub enum FileError {
    /// The system could not read or write.
    #[error("input or output failed at byte {position}: {source}")]
    Io {
        /// Bytes read or written before.
        position: u64,
        /// What the system said.
        source: io::Error,
    },
    /// It is some other file.
    #[error("not a map file: it starts with {found:02x?} instead of \"LATTICE1\"")]
    Magic {
        /// The first eight bytes.
        found: [u8; 8],
    },
    /// The end comes too early.
    #[error("the map file is cut short: it ends at byte {position}")]
    Truncated {
        /// Length of the file.
        position: u64,
    },
    /// More voxels than the caller allows.
    #[error(
        "the map file has {voxels} voxels, but at most {max_voxels} are allowed: raise max_voxels"
    )]
    TooManyVoxels {
        /// Voxels in the file.
        voxels: u64,
        /// What the caller allows.
        max_voxels: usize,
    },
    /// The bytes cannot be a map.
    #[error("the map file is damaged before byte {position}: {reason}")]
    Corrupt {
        /// Where reading stopped.
        position: u64,
        /// What is impossible.
        reason: String,
    },
    /// The checksum does not match.
    #[error(
        "the map file is damaged: its CRC is {saved:08x}, that of its content {calculated:08x}"
    )]
    Checksum {
        /// In the file.
        saved: u32,
        /// From the content.
        calculated: u32,
    },
    /// Something follows the checksum.
    #[error("the map ends at byte {position}, but the file goes on")]
    TrailingBytes {
        /// Length that the file should have.
        position: u64,
    },
}

/// Writes a map; equal maps give equal bytes.
pub fn write_map(list: &VoxelList, writer: impl Write) -> Result<(), FileError> {
    let mut sink = Sink {
        writer,
        bytes: Vec::new(),
        crc: crc32fast::Hasher::new(),
        position: 0,
    };
    let mut name = [0; 8];
    name.iter_mut()
        .zip(list.lattice.kind().name().bytes())
        .for_each(|(to, from)| *to = from);
    sink.bytes.extend(MAGIC);
    sink.bytes.extend(name);
    sink.bytes
        .extend(list.lattice.cell_volume_m3().to_le_bytes());
    list.datum_index
        .iter()
        .for_each(|i| sink.bytes.extend(i.to_le_bytes()));
    sink.bytes.extend(list.sums.points.to_le_bytes());
    sink.bytes.extend(list.sums.squares.to_le_bytes());
    sink.bytes.extend(list.sums.distances.to_le_bytes());
    sink.bytes.extend(list.sums.largest_square.to_le_bytes());
    sink.bytes.extend((list.len() as u64).to_le_bytes());
    let mut before = 0;
    for (key, voxel) in list.sorted() {
        push_varint(&mut sink.bytes, key.raw() - before);
        push_varint(&mut sink.bytes, u64::from(voxel.count));
        voxel
            .sum
            .iter()
            .for_each(|&sum| push_varint(&mut sink.bytes, zigzag(sum)));
        before = key.raw();
        if sink.bytes.len() >= BUFFER {
            sink.write()?;
        }
    }
    sink.write()?;
    let crc = sink.crc.clone().finalize();
    sink.bytes.extend(crc.to_le_bytes());
    sink.write()?;
    sink.writer.flush().map_err(|source| FileError::Io {
        position: sink.position,
        source,
    })
}

/// Reads a map of at most `max_voxels`, which becomes its bound; all voxels count as changed.
///
/// Refuses anything that `write_map` does not write, and allocates no more than the input justifies.
pub fn read_map(reader: impl Read, max_voxels: usize) -> Result<VoxelList, FileError> {
    let mut source = Source::new(reader);
    let magic: [u8; 8] = source.array()?;
    if magic != *MAGIC {
        return Err(FileError::Magic { found: magic });
    }
    let name: [u8; 8] = source.array()?;
    let kind = LatticeKind::ALL.into_iter().find(|kind| {
        let (start, fill) = name.split_at(kind.name().len());
        start == kind.name().as_bytes() && fill.iter().all(|&b| b == 0)
    });
    let kind = kind.ok_or_else(|| {
        source.corrupt(format!(
            "unknown lattice {:?}",
            name.escape_ascii().to_string()
        ))
    })?;
    let volume = f64::from_le_bytes(source.array()?);
    let lattice = Lattice::new(kind, volume).map_err(|error| source.corrupt(error.to_string()))?;
    let mut datum_index = [0; 3];
    for index in &mut datum_index {
        *index = i64::from_le_bytes(source.array()?);
    }
    let mut list = VoxelList::at_datum(lattice, datum_index, max_voxels);
    if list.lattice.quantize_wide(&list.datum_m).is_none() {
        return Err(source.corrupt(format!("datum index {datum_index:?} is out of range")));
    }
    list.sums = DistortionSums {
        points: u64::from_le_bytes(source.array()?),
        squares: u128::from_le_bytes(source.array()?),
        distances: u128::from_le_bytes(source.array()?),
        largest_square: u64::from_le_bytes(source.array()?),
    };
    let voxels = u64::from_le_bytes(source.array()?);
    if voxels > max_voxels as u64 {
        return Err(FileError::TooManyVoxels { voxels, max_voxels });
    }
    read_voxels(&mut source, &mut list, voxels)?;
    list.validate().map_err(|reason| source.corrupt(reason))?;
    source.finish()?;
    Ok(list)
}

fn read_voxels<R: Read>(
    source: &mut Source<R>,
    list: &mut VoxelList,
    voxels: u64,
) -> Result<(), FileError> {
    let reach = list.reach();
    let mut before: Option<Key> = None;
    for _ in 0..voxels {
        let step = source.varint()?;
        let count = source.varint()?;
        let sum = [source.varint()?, source.varint()?, source.varint()?].map(unzigzag);
        let Some(key) = next_key(before, step) else {
            return Err(source.corrupt("a key does not ascend or is not below 2^63".to_owned()));
        };
        let Ok(count) = u32::try_from(count) else {
            return Err(source.corrupt(format!("a voxel has {count} points")));
        };
        let voxel = Voxel { count, sum };
        if let Some(fault) = voxel.fault(reach) {
            return Err(source.corrupt(fault));
        }
        list.add(key, &voxel);
        before = Some(key);
    }
    Ok(())
}

/// Collects bytes, sums them up and writes them.
struct Sink<W> {
    writer: W,
    bytes: Vec<u8>,
    crc: crc32fast::Hasher,
    position: u64,
}

impl<W: Write> Sink<W> {
    fn write(&mut self) -> Result<(), FileError> {
        self.crc.update(&self.bytes);
        let written = self.writer.write_all(&self.bytes);
        written.map_err(|source| FileError::Io {
            position: self.position,
            source,
        })?;
        self.position += self.bytes.len() as u64;
        self.bytes.clear();
        Ok(())
    }
}

/// Hands out bytes and knows their place and checksum.
struct Source<R> {
    reader: R,
    buffer: Vec<u8>,
    /// Bytes of the buffer that are valid, and handed out.
    filled: usize,
    used: usize,
    /// Of the bytes in earlier buffers.
    crc: crc32fast::Hasher,
    start: u64,
}

impl<R: Read> Source<R> {
    fn new(reader: R) -> Source<R> {
        let (buffer, crc) = (vec![0; BUFFER], crc32fast::Hasher::new());
        Source {
            reader,
            buffer,
            filled: 0,
            used: 0,
            crc,
            start: 0,
        }
    }

    fn position(&self) -> u64 {
        self.start + self.used as u64
    }

    fn corrupt(&self, reason: String) -> FileError {
        FileError::Corrupt {
            position: self.position(),
            reason,
        }
    }

    fn handed_out(&self) -> &[u8] {
        self.buffer.get(..self.used).unwrap_or_default()
    }

    /// The next byte, `None` at the end.
    fn next(&mut self) -> Result<Option<u8>, FileError> {
        if self.used == self.filled {
            let mut crc = self.crc.clone();
            crc.update(self.handed_out());
            (self.crc, self.start) = (crc, self.position());
            (self.used, self.filled) = (0, 0);
            self.filled = loop {
                match self.reader.read(&mut self.buffer) {
                    Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                    Err(source) => {
                        return Err(FileError::Io {
                            position: self.start,
                            source,
                        });
                    }
                    Ok(filled) => break filled,
                }
            };
        }
        let valid = self.buffer.get(..self.filled).unwrap_or_default();
        let byte = valid.get(self.used).copied();
        self.used += usize::from(byte.is_some());
        Ok(byte)
    }

    fn byte(&mut self) -> Result<u8, FileError> {
        self.next()?.ok_or(FileError::Truncated {
            position: self.position(),
        })
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], FileError> {
        let mut bytes = [0; N];
        for byte in &mut bytes {
            *byte = self.byte()?;
        }
        Ok(bytes)
    }

    fn varint(&mut self) -> Result<u64, FileError> {
        let mut varint = Varint::default();
        loop {
            let byte = self.byte()?;
            match varint.push(byte) {
                Ok(Some(value)) => return Ok(value),
                Ok(None) => {}
                Err(NotShortest) => {
                    return Err(self.corrupt("a number is not a shortest 64-bit varint".to_owned()));
                }
            }
        }
    }

    /// Reads and checks the checksum and the end.
    fn finish(&mut self) -> Result<(), FileError> {
        let mut crc = self.crc.clone();
        crc.update(self.handed_out());
        let (saved, calculated) = (u32::from_le_bytes(self.array()?), crc.finalize());
        if saved != calculated {
            return Err(FileError::Checksum { saved, calculated });
        }
        let position = self.position();
        if self.next()?.is_some() {
            Err(FileError::TrailingBytes { position })
        } else {
            Ok(())
        }
    }
}
