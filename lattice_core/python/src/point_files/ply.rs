//! PLY: a header of elements and their properties, and the elements as text or binary.

use super::record::{Field, Layout, Number, Order};
use super::{PointFile, header_of};

struct Element {
    name: String,
    layout: Layout,
    has_lists: bool,
}

/// Reads the vertices of a file; earlier elements are skipped, later ones not read.
pub fn read(bytes: &[u8]) -> Result<PointFile, String> {
    let (lines, mut data) = header_of(bytes, |line| line == "end_header")?;
    let mut format = None;
    let mut elements: Vec<Element> = Vec::new();
    for (number, line) in lines.iter().enumerate() {
        let wrong = || format!("line {} of the header: {line:?}", number + 1);
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words.as_slice() {
            ["format", kind, "1.0"] => format = Some(*kind),
            ["element", name, count] => elements.push(Element {
                name: (*name).to_owned(),
                layout: Layout {
                    fields: Vec::new(),
                    rows: count.parse().map_err(|_| wrong())?,
                },
                has_lists: false,
            }),
            ["property", "list", ..] => elements.last_mut().ok_or_else(wrong)?.has_lists = true,
            ["property", kind, name] => {
                let element = elements.last_mut().ok_or_else(wrong)?;
                element.layout.fields.push(Field {
                    name: (*name).to_owned(),
                    number: number_of(kind).ok_or_else(wrong)?,
                    count: 1,
                });
            }
            ["format" | "element" | "property", ..] => return Err(wrong()),
            // Comments and similar lines.
            _ => {}
        }
    }
    let order = match format {
        Some("ascii") => None,
        Some("binary_little_endian") => Some(Order::Little),
        Some("binary_big_endian") => Some(Order::Big),
        other => return Err(format!("format {other:?} is none of PLY")),
    };
    let mut lines_before = 0_usize;
    for element in &elements {
        let (name, layout) = (&element.name, &element.layout);
        if element.has_lists && (name == "vertex" || order.is_some()) {
            return Err(format!(
                "element {name} has lists, which are passed over only after the vertices"
            ));
        }
        if name != "vertex" {
            match order {
                None => lines_before = lines_before.saturating_add(layout.rows),
                Some(_) => data = data.get(layout.bytes()..).unwrap_or_default(),
            }
            continue;
        }
        return match order {
            None => layout.read_text(data, lines_before),
            Some(order) => layout.read_binary(data, order),
        };
    }
    Err("the header has no element vertex".to_owned())
}

/// Header of points and labels.
pub fn header(points: usize, single: bool, labels: bool) -> String {
    let kind = if single { "float" } else { "double" };
    let label = if labels {
        "property ushort label\n"
    } else {
        ""
    };
    format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {points}\nproperty {kind} x\nproperty {kind} y\n\
         property {kind} z\n{label}end_header\n"
    )
}

fn number_of(kind: &str) -> Option<Number> {
    Some(match kind {
        "char" | "int8" => Number::I8,
        "uchar" | "uint8" => Number::U8,
        "short" | "int16" => Number::I16,
        "ushort" | "uint16" => Number::U16,
        "int" | "int32" => Number::I32,
        "uint" | "uint32" => Number::U32,
        "float" | "float32" => Number::F32,
        "double" | "float64" => Number::F64,
        _ => return None,
    })
}
