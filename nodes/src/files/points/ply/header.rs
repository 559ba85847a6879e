//! Header of a PLY file.

use crate::files::points::scalar::Scalar;
use crate::files::points::source::Source;
use crate::files::points::{PointFileError, PointFormat};

/// Limit of header lines.
const MAX_LINES: u64 = 10_000;

/// Structure of the data after the header.
#[derive(Debug)]
pub struct Header {
    /// One of the PLY formats.
    pub format: PointFormat,
    /// Elements in the order of the data.
    pub elements: Vec<Element>,
    /// Number of header lines.
    pub lines: u64,
}

/// Header element: a number of records with common properties.
#[derive(Debug)]
pub struct Element {
    /// Name, such as `vertex`.
    pub name: String,
    /// Number of records.
    pub count: u64,
    /// Properties in the order of a record.
    pub properties: Vec<Property>,
}

/// Property of an element.
#[derive(Debug)]
pub enum Property {
    /// One number per record.
    Scalar {
        /// Name, such as `x`.
        name: String,
        /// Type of the number.
        scalar: Scalar,
    },
    /// A list per record.
    List {
        /// Name, such as `vertex_indices`.
        name: String,
        /// Type of its length.
        count: Scalar,
        /// Type of its items.
        item: Scalar,
    },
}

impl Header {
    /// Reads up to and including the line `end_header`.
    pub fn read(source: &mut Source) -> Result<Header, PointFileError> {
        let mut header = Header {
            format: PointFormat::PlyAscii,
            elements: Vec::new(),
            lines: 0,
        };
        let mut has_format = false;
        loop {
            let line = source.expect_line("the header, before end_header")?;
            header.lines += 1;
            let mut words = line.split_whitespace();
            let keyword = words.next().unwrap_or_default();
            let rest: Vec<&str> = words.collect();
            let parsed = match (header.lines, keyword, rest.as_slice()) {
                (1, "ply", []) => Ok(()),
                (1, ..) => Err("not a PLY file, which starts with \"ply\"".to_owned()),
                (MAX_LINES.., ..) => Err(format!("the header has {MAX_LINES} lines or more")),
                (_, "end_header", []) if !has_format => Err("no line gives the format".to_owned()),
                (_, "end_header", []) => return Ok(header),
                (_, "comment" | "obj_info", _) | (_, "", []) => Ok(()),
                (_, "format", [name, "1.0"]) => {
                    has_format = true;
                    format(name).map(|format| header.format = format)
                }
                (_, "element", [name, count]) => {
                    element(name, count).map(|element| header.elements.push(element))
                }
                (_, "property", words) => match header.elements.last_mut() {
                    Some(element) => property(words).map(|p| element.properties.push(p)),
                    None => Err("a property before the first `element` line".to_owned()),
                },
                _ => Err(format!(
                    "{:?} is not a line of a PLY 1.0 header",
                    shorten(&line)
                )),
            };
            parsed.map_err(|reason| PointFileError::Line {
                format: header.format,
                line: header.lines,
                reason,
            })?;
        }
    }
}

fn shorten(line: &str) -> String {
    line.chars().take(60).collect()
}

fn format(name: &str) -> Result<PointFormat, String> {
    match name {
        "ascii" => Ok(PointFormat::PlyAscii),
        "binary_little_endian" => Ok(PointFormat::PlyBinaryLittleEndian),
        "binary_big_endian" => Ok(PointFormat::PlyBinaryBigEndian),
        _ => Err(format!("unknown format {:?}", shorten(name))),
    }
}

fn element(name: &str, count: &str) -> Result<Element, String> {
    let fault = || format!("{:?} is not a number of elements", shorten(count));
    Ok(Element {
        name: name.to_owned(),
        count: count.parse().map_err(|_| fault())?,
        properties: Vec::new(),
    })
}

fn property(words: &[&str]) -> Result<Property, String> {
    match words {
        ["list", count, item, name] => {
            let (count, item) = (scalar(count)?, scalar(item)?);
            if count.is_float() {
                let name = shorten(name);
                return Err(format!(
                    "the length of list {name:?} is a float, not an integer type"
                ));
            }
            let name = (*name).to_owned();
            Ok(Property::List { name, count, item })
        }
        [of, name] => Ok(Property::Scalar {
            name: (*name).to_owned(),
            scalar: scalar(of)?,
        }),
        _ => Err("a property is a type and a name, or list, two types and a name".to_owned()),
    }
}

fn scalar(name: &str) -> Result<Scalar, String> {
    Ok(match name {
        "char" | "int8" => Scalar::I8,
        "uchar" | "uint8" => Scalar::U8,
        "short" | "int16" => Scalar::I16,
        "ushort" | "uint16" => Scalar::U16,
        "int" | "int32" => Scalar::I32,
        "uint" | "uint32" => Scalar::U32,
        "float" | "float32" => Scalar::F32,
        "double" | "float64" => Scalar::F64,
        _ => return Err(format!("unknown type {:?}", shorten(name))),
    })
}
