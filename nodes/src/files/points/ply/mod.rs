//! PLY: a header that names elements and their properties, and the elements, as text or binary.
//!
//! Points are the element `vertex`. Elements before it are passed over, what follows is not read.

mod header;
pub(super) mod mesh;
mod record;

use header::{Element, Header, Property};

use super::collect::Collector;
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
        points.promise(element.count)?;
        for number in 1..=element.count {
            let part = format_args!("vertex {number} of {}", element.count);
            let mut point_m = [f64::NAN; 3];
            record::read(source, &header, element, part, |property, value| {
                for (coordinate, axis) in point_m.iter_mut().zip(axes) {
                    if axis == property {
                        *coordinate = value;
                    }
                }
            })?;
            points.push(point_m)?;
        }
        return Ok(header.format);
    }
    Err(fault("the header has no element vertex".to_owned()))
}

/// Which properties of the vertex are x, y and z.
fn axes(vertex: &Element) -> Result<[usize; 3], String> {
    let find = |axis: &str| {
        let is_axis = |p: &Property| matches!(p, Property::Scalar { name, .. } if name == axis);
        let found = vertex.properties.iter().position(is_axis);
        found.ok_or_else(|| format!("element vertex has no number named {axis}"))
    };
    Ok([find("x")?, find("y")?, find("z")?])
}

#[cfg(test)]
mod tests;
