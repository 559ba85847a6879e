//! Header of a PCD file.

use super::viewpoint;
use crate::files::points::label::label_among;
use crate::files::points::scalar::Scalar;
use crate::files::points::source::Source;
use crate::files::points::{PointFileError, PointFormat};

/// Limit of header lines.
const MAX_LINES: u64 = 1000;
/// Limit of bytes per point.
const MAX_POINT_BYTES: u64 = 1 << 20;

/// Layout of x, y and z in the data.
#[derive(Debug)]
pub(super) struct Header {
    /// One of the PCD formats.
    pub(super) format: PointFormat,
    /// Number of points.
    pub(super) points: u64,
    /// Rows of an organised cloud, else 1.
    pub(super) rows: u64,
    /// Bytes per point.
    pub(super) point_bytes: u64,
    /// Numbers per point.
    pub(super) columns: u64,
    /// x, y and z.
    pub(super) axes: [Axis; 3],
    /// Class, if there is a scalar field `label`.
    pub(super) label: Option<Axis>,
    /// Warning about a sensor pose other than the identity.
    pub(super) viewpoint: Option<String>,
}

/// Position of one number.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    pub(super) scalar: Scalar,
    /// Byte offset in a point.
    pub(super) offset: u64,
    /// Column in a point.
    pub(super) column: u64,
}

/// Header lines as read.
#[derive(Default)]
struct Lines {
    fields: Vec<String>,
    size: Vec<u64>,
    kind: Vec<String>,
    count: Option<Vec<u64>>,
    width: Option<u64>,
    height: Option<u64>,
    points: Option<u64>,
    viewpoint: Option<String>,
}

impl Header {
    pub(super) fn read(source: &mut Source) -> Result<Header, PointFileError> {
        let mut lines = Lines::default();
        for number in 1..MAX_LINES {
            let line = source.expect_line("the header, before DATA")?;
            let parsed = lines.take(&line).and_then(|data| match data {
                Some(format) => lines.header(format).map(Some),
                None => Ok(None),
            });
            match parsed {
                Ok(None) => {}
                Ok(Some(header)) => return Ok(header),
                Err(reason) => return Err(fault(number, reason)),
            }
        }
        let reason = format!("not a PCD file: no DATA in its first {MAX_LINES} lines");
        Err(fault(MAX_LINES, reason))
    }
}

/// Header error; the format is not known before the last line.
fn fault(line: u64, reason: String) -> PointFileError {
    PointFileError::Line {
        format: PointFormat::PcdAscii,
        line,
        reason,
    }
}

impl Lines {
    /// Stores a line; returns the format at the last one.
    fn take(&mut self, line: &str) -> Result<Option<PointFormat>, String> {
        let mut words = line.split_whitespace();
        let keyword = words.next().unwrap_or_default();
        let words: Vec<&str> = words.collect();
        match (keyword, words.as_slice()) {
            ("VERSION", ["0.7" | ".7"]) | ("", _) => {}
            ("VIEWPOINT", words) => self.viewpoint = viewpoint::remark(words),
            _ if keyword.starts_with('#') => {}
            ("FIELDS", names) => self.fields = names.iter().map(|&name| name.to_owned()).collect(),
            ("SIZE", sizes) => self.size = integers(sizes)?,
            ("TYPE", types) => self.kind = types.iter().map(|&of| of.to_owned()).collect(),
            ("COUNT", counts) => self.count = Some(integers(counts)?),
            ("WIDTH", [width]) => self.width = Some(integer(width)?),
            ("HEIGHT", [height]) => self.height = Some(integer(height)?),
            ("POINTS", [points]) => self.points = Some(integer(points)?),
            ("DATA", ["ascii"]) => return Ok(Some(PointFormat::PcdAscii)),
            ("DATA", ["binary"]) => return Ok(Some(PointFormat::PcdBinary)),
            ("DATA", ["binary_compressed"]) => return Ok(Some(PointFormat::PcdBinaryCompressed)),
            _ => {
                let line: String = line.chars().take(60).collect();
                return Err(format!("{line:?} is not a line of a PCD 0.7 header"));
            }
        }
        Ok(None)
    }

    /// Header from all lines.
    fn header(&self, format: PointFormat) -> Result<Header, String> {
        let fields = self.fields.len();
        let ones = vec![1; fields];
        let count = self.count.as_ref().unwrap_or(&ones);
        if [self.size.len(), self.kind.len(), count.len()] != [fields; 3] {
            return Err(format!(
                "FIELDS, SIZE, TYPE and COUNT have {fields}, {}, {} and {} entries, which must agree",
                self.size.len(),
                self.kind.len(),
                count.len()
            ));
        }
        let (mut offset, mut column) = (0_u64, 0_u64);
        let (mut axes, mut label) = ([None; 3], None);
        let sizes = self.size.iter().zip(&self.kind).zip(count);
        let label_at = label_among(self.fields.iter().map(String::as_str));
        for (at, (name, ((&size, kind), &count))) in self.fields.iter().zip(sizes).enumerate() {
            let place = |scalar| Axis {
                scalar,
                offset,
                column,
            };
            for (axis, letter) in axes.iter_mut().zip(["x", "y", "z"]) {
                if name == letter {
                    *axis = Some(place(coordinate(name, kind, size, count)?));
                }
            }
            if let (true, Some(scalar), 1) = (label_at == Some(at), number_kind(kind, size), count)
            {
                label = Some(place(scalar));
            }
            column = column.saturating_add(count);
            offset = offset.saturating_add(size.saturating_mul(count));
        }
        let [Some(x), Some(y), Some(z)] = axes else {
            let fields = &self.fields;
            return Err(format!("FIELDS are {fields:?}, without all of x, y and z"));
        };
        if offset > MAX_POINT_BYTES || column > MAX_POINT_BYTES {
            let most = MAX_POINT_BYTES;
            return Err(format!("a point has {offset} bytes, more than {most}"));
        }
        Ok(Header {
            format,
            points: self.points()?,
            rows: self.height.unwrap_or(1),
            point_bytes: offset,
            columns: column,
            axes: [x, y, z],
            label,
            viewpoint: self.viewpoint.clone(),
        })
    }

    fn points(&self) -> Result<u64, String> {
        let size = self.width.zip(self.height);
        let product = size.map(|(width, height)| width.saturating_mul(height));
        match (self.points, product) {
            (Some(points), Some(product)) if points != product => Err(format!(
                "POINTS is {points}, but WIDTH times HEIGHT is {product}"
            )),
            (Some(points), _) | (None, Some(points)) => Ok(points),
            (None, None) => Err("neither POINTS nor WIDTH and HEIGHT are given".to_owned()),
        }
    }
}

fn integers(words: &[&str]) -> Result<Vec<u64>, String> {
    words.iter().copied().map(integer).collect()
}

fn integer(word: &str) -> Result<u64, String> {
    word.parse().map_err(|_| {
        let word: String = word.chars().take(40).collect();
        format!("{word:?} is not a number without sign")
    })
}

fn number_kind(kind: &str, size: u64) -> Option<Scalar> {
    Some(match (kind, size) {
        ("I", 1) => Scalar::I8,
        ("U", 1) => Scalar::U8,
        ("I", 2) => Scalar::I16,
        ("U", 2) => Scalar::U16,
        ("I", 4) => Scalar::I32,
        ("U", 4) => Scalar::U32,
        ("F", 4) => Scalar::F32,
        ("F", 8) => Scalar::F64,
        _ => return None,
    })
}

fn coordinate(name: &str, kind: &str, size: u64, count: u64) -> Result<Scalar, String> {
    match (kind, size, count) {
        ("F", 4, 1) => Ok(Scalar::F32),
        ("F", 8, 1) => Ok(Scalar::F64),
        _ => {
            let kind: String = kind.chars().take(40).collect();
            Err(format!(
                "{name} is TYPE {kind}, SIZE {size}, COUNT {count}, but must be one F of 4 or 8 bytes"
            ))
        }
    }
}
