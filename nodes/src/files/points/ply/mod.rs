//! PLY: a header of elements and properties, and their records, as text or binary.
//!
//! Points are the records of the element `vertex`; a property `label`, or another usual name, is their class.
//! Elements before it are skipped, those after it are not read.

pub mod header;
pub mod record;

use header::{Element, Header, Property};

use lattice_core::registration::UNLABELED;

use super::collect::Collector;
use super::label::label_among;
use super::source::Source;
use super::{PointFileError, PointFormat};

pub(super) fn read(
    source: &mut Source,
    points: &mut Collector,
) -> Result<PointFormat, PointFileError> {
    let header = Header::read(source)?;
    let fault = |reason: String| PointFileError::Line {
        format: header.format,
        line: header.lines,
        reason,
    };
    for element in &header.elements {
        if element.name != "vertex" {
            record::skip(source, &header, element)?;
            continue;
        }
        let axes = axes(element).map_err(fault)?;
        let names = element.properties.iter().map(|property| match property {
            Property::Scalar { name, .. } => name.as_str(),
            Property::List { .. } => "",
        });
        let label = label_among(names.clone());
        let label_name = label
            .and_then(|at| names.clone().nth(at))
            .unwrap_or_default();
        points.promise(element.count)?;
        for number in 1..=element.count {
            let part = format_args!("vertex {number} of {}", element.count);
            let mut point_m = [f64::NAN; 3];
            let mut class = f64::NAN;
            record::read(source, &header, element, part, |property, value| {
                for (coordinate, axis) in point_m.iter_mut().zip(axes) {
                    if axis == property {
                        *coordinate = value;
                    }
                }
                if label == Some(property) {
                    class = value;
                }
            })?;
            if label.is_none() {
                points.push(point_m)?;
                continue;
            }
            let class = class_of(class).ok_or_else(|| PointFileError::Data {
                format: header.format,
                byte: source.byte(),
                reason: format!(
                    "{label_name} {class} is not an integer in 0..=65535 or -1, in {part}"
                ),
            })?;
            points.push_labelled(point_m, class)?;
        }
        return Ok(header.format);
    }
    Err(fault("the header has no element vertex".to_owned()))
}

/// Indices of x, y and z among the vertex properties.
pub fn axes(vertex: &Element) -> Result<[usize; 3], String> {
    let find = |axis: &str| {
        let found = number(vertex, axis);
        found.ok_or_else(|| format!("element vertex has no number named {axis}"))
    };
    Ok([find("x")?, find("y")?, find("z")?])
}

/// Index of a scalar property by its name.
pub fn number(element: &Element, wanted: &str) -> Option<usize> {
    let is = |p: &Property| matches!(p, Property::Scalar { name, .. } if name == wanted);
    element.properties.iter().position(is)
}

/// Class number; -1 and 65535 are unlabelled.
fn class_of(value: f64) -> Option<u16> {
    if value == -1.0 {
        return Some(UNLABELED);
    }
    let whole = value.fract() == 0.0 && (0.0..=f64::from(u16::MAX)).contains(&value);
    whole.then_some(value as u16)
}

#[cfg(test)]
mod tests;
