//! Records of one element of a PLY file.

use std::fmt::Display;

use super::header::{Element, Header, Property};
use crate::files::points::scalar::Scalar;
use crate::files::points::source::Source;
use crate::files::points::text::number;
use crate::files::points::{PointFileError, PointFormat};

/// Reads the next record of an element: `visit` gets the index and value of each scalar property.
pub fn read(
    source: &mut Source,
    header: &Header,
    element: &Element,
    part: impl Display,
    visit: impl FnMut(usize, f64),
) -> Result<(), PointFileError> {
    read_with_list(source, header, element, None, part, visit)
}

/// Reads as [`read`]; `visit` also gets the items of the list property `list` in sequence.
pub fn read_with_list(
    source: &mut Source,
    header: &Header,
    element: &Element,
    list: Option<usize>,
    part: impl Display,
    visit: impl FnMut(usize, f64),
) -> Result<(), PointFileError> {
    match header.format {
        PointFormat::PlyAscii => read_text(source, element, list, part, visit),
        _ => read_binary(source, header.format, element, list, part, visit),
    }
}

/// Skips all records of an element.
pub fn skip(source: &mut Source, header: &Header, element: &Element) -> Result<(), PointFileError> {
    let Element {
        name,
        count,
        properties,
    } = element;
    let of_scalar = |property: &Property| match property {
        Property::Scalar { scalar, .. } => Some(scalar.size() as u64),
        Property::List { .. } => None,
    };
    let size: Option<u64> = properties.iter().map(of_scalar).sum();
    match (header.format, size) {
        (_, Some(0)) => Ok(()),
        (PointFormat::PlyAscii, _) | (_, None) => (1..=*count).try_for_each(|number| {
            let part = format_args!("{name} {number} of {count}");
            read(source, header, element, part, |_, _| ())
        }),
        (_, Some(size)) => {
            let part = format_args!("the {count} of {name}");
            source.skip(size.saturating_mul(*count), part)
        }
    }
}

fn read_binary(
    source: &mut Source,
    format: PointFormat,
    element: &Element,
    list: Option<usize>,
    part: impl Display,
    mut visit: impl FnMut(usize, f64),
) -> Result<(), PointFileError> {
    let value = |source: &mut Source, scalar: Scalar| -> Result<f64, PointFileError> {
        let mut bytes = [0; 8];
        let (bytes, _) = bytes.split_at_mut(scalar.size());
        source.exact(bytes, &part)?;
        if format == PointFormat::PlyBinaryBigEndian {
            bytes.reverse();
        }
        Ok(scalar.decode(bytes).unwrap_or(f64::NAN))
    };
    for (index, property) in element.properties.iter().enumerate() {
        match property {
            Property::Scalar { scalar, .. } => visit(index, value(source, *scalar)?),
            Property::List { count, item, .. } => {
                let byte = source.byte();
                let length = value(source, *count)?;
                if length < 0.0 {
                    let reason = format!("a list of length {length} in {part}");
                    return Err(PointFileError::Data {
                        format,
                        byte,
                        reason,
                    });
                }
                if list == Some(index) {
                    for _ in 0..length as u64 {
                        visit(index, value(source, *item)?);
                    }
                    continue;
                }
                // At most 2^32 numbers of 8 bytes.
                source.skip(length as u64 * item.size() as u64, &part)?;
            }
        }
    }
    Ok(())
}

/// Reads one record per line; empty lines are ignored.
fn read_text(
    source: &mut Source,
    element: &Element,
    list: Option<usize>,
    part: impl Display,
    mut visit: impl FnMut(usize, f64),
) -> Result<(), PointFileError> {
    let mut record = String::new();
    while record.is_empty() {
        record.push_str(source.expect_line(&part)?.trim());
    }
    let mut words = record.split_whitespace();
    let mut fields = || -> Result<(), String> {
        let cut = || format!("the line ends early, in {part}");
        for (index, property) in element.properties.iter().enumerate() {
            let word = words.next().ok_or_else(cut)?;
            let shown: String = word.chars().take(40).collect();
            match property {
                Property::Scalar { .. } => {
                    let fault = || format!("{shown:?} is not a number, in {part}");
                    visit(index, number(word).ok_or_else(fault)?);
                }
                Property::List { .. } => {
                    let fault = |_| format!("{shown:?} is not the length of a list, in {part}");
                    let length: u32 = word.parse().map_err(fault)?;
                    for _ in 0..length {
                        let word = words.next().ok_or_else(cut)?;
                        if list == Some(index) {
                            visit(index, number(word).unwrap_or(f64::NAN));
                        }
                    }
                }
            }
        }
        match words.next() {
            Some(_) => Err(format!("the line has more than the properties of {part}")),
            None => Ok(()),
        }
    };
    fields().map_err(|reason| PointFileError::Line {
        format: PointFormat::PlyAscii,
        line: source.line_number(),
        reason,
    })
}
