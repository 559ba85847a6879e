//! Vertices and indices from buffers.

use super::buffers::Buffers;
use super::document::Document;

/// Number encoding of an accessor.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Form {
    component_type: u32,
    normalized: bool,
}

impl Form {
    /// Bytes per number; `None` for an unknown type.
    fn bytes(self) -> Option<usize> {
        match self.component_type {
            5120 | 5121 => Some(1),
            5122 | 5123 => Some(2),
            5125 | 5126 => Some(4),
            _ => None,
        }
    }

    /// Decodes a number of [`Form::bytes`] bytes.
    fn number(self, bytes: &[u8]) -> f64 {
        let (value, most) = match (self.component_type, bytes) {
            (5120, &[a]) => (f64::from(a as i8), f64::from(i8::MAX)),
            (5121, &[a]) => (f64::from(a), f64::from(u8::MAX)),
            (5122, &[a, b]) => (f64::from(i16::from_le_bytes([a, b])), f64::from(i16::MAX)),
            (5123, &[a, b]) => (f64::from(u16::from_le_bytes([a, b])), f64::from(u16::MAX)),
            (5126, &[a, b, c, d]) => (f64::from(f32::from_le_bytes([a, b, c, d])), 1.0),
            _ => (f64::NAN, 1.0),
        };
        match self.normalized {
            true => (value / most).max(-1.0),
            false => value,
        }
    }
}

/// Records of an accessor: bytes from the first one on, and their stride.
struct Records<'a> {
    bytes: &'a [u8],
    stride: usize,
    size: usize,
    count: usize,
    form: Form,
}

impl<'a> Records<'a> {
    fn iter(&self) -> impl Iterator<Item = &'a [u8]> {
        let (bytes, stride, size) = (self.bytes, self.stride, self.size);
        (0..self.count).map(move |i| bytes.get(i * stride..i * stride + size).unwrap_or_default())
    }
}

/// Number of records stated by an accessor.
pub(super) fn count(document: &Document, number: usize) -> Result<u64, String> {
    let accessor = document.accessors.0.get(number);
    let accessor = accessor.ok_or_else(|| format!("there is no accessor {number}"))?;
    match accessor.count {
        // Without this, documents could list free accessors without end.
        0 => Err(format!("accessor {number}: it has no records")),
        count => Ok(count),
    }
}

/// Vertices of a position accessor. `quantized` allows integers (`KHR_mesh_quantization`).
pub(super) fn positions(
    document: &Document,
    buffers: &mut Buffers<'_>,
    number: usize,
    quantized: bool,
) -> Result<Vec<[f64; 3]>, String> {
    let allowed: &[u32] = match quantized {
        true => &[5120, 5121, 5122, 5123, 5126],
        false => &[5126],
    };
    let records = records(document, buffers, number, ("VEC3", 3), allowed)?;
    let size = records.form.bytes().unwrap_or(1);
    let vertex = |record: &[u8]| {
        let mut numbers = record.chunks(size).map(|bytes| records.form.number(bytes));
        [(); 3].map(|()| numbers.next().unwrap_or(f64::NAN))
    };
    Ok(records.iter().map(vertex).collect())
}

/// Vertex indices of an index accessor.
pub(super) fn corners(
    document: &Document,
    buffers: &mut Buffers<'_>,
    number: usize,
) -> Result<Vec<u32>, String> {
    let records = records(
        document,
        buffers,
        number,
        ("SCALAR", 1),
        &[5121, 5123, 5125],
    )?;
    let corner = |record: &[u8]| match *record {
        [a] => u32::from(a),
        [a, b] => u32::from(u16::from_le_bytes([a, b])),
        [a, b, c, d] => u32::from_le_bytes([a, b, c, d]),
        _ => u32::MAX,
    };
    Ok(records.iter().map(corner).collect())
}

/// Records of an accessor, checked to be within its view.
fn records<'b>(
    document: &Document,
    buffers: &'b mut Buffers<'_>,
    number: usize,
    (kind, numbers): (&str, usize),
    allowed: &[u32],
) -> Result<Records<'b>, String> {
    let accessor = document.accessors.0.get(number);
    let accessor = accessor.ok_or_else(|| format!("there is no accessor {number}"))?;
    let refuse = |reason: String| Err(format!("accessor {number}: {reason}"));
    let form = Form {
        component_type: accessor.component_type,
        normalized: accessor.normalized && accessor.component_type != 5126,
    };
    if accessor.kind != kind {
        let found: String = accessor.kind.chars().take(16).collect();
        return refuse(format!("type {found}, not {kind}"));
    }
    let Some(bytes) = form
        .bytes()
        .filter(|_| allowed.contains(&form.component_type))
    else {
        let found = form.component_type;
        return refuse(format!("component type {found}, not one of {allowed:?}"));
    };
    if accessor.sparse.is_some() {
        return refuse("sparse accessors are not supported".to_owned());
    }
    let Some(view_number) = accessor.buffer_view else {
        return refuse("it has no buffer view".to_owned());
    };
    let size = bytes * numbers;
    let (view, stride) = buffers.view(view_number)?;
    let stride = stride.unwrap_or(size as u64);
    if stride < size as u64 || stride > 252.max(size as u64) {
        return refuse(format!("byteStride {stride} is outside {size}..=252"));
    }
    let last = accessor.count.checked_sub(1);
    let end = last.and_then(|last| last.checked_mul(stride)?.checked_add(size as u64));
    let end = end.and_then(|end| end.checked_add(accessor.byte_offset));
    let has = view.len();
    let start = usize::try_from(accessor.byte_offset).ok();
    let first = start.and_then(|start| view.get(start..));
    match (first, end, usize::try_from(accessor.count)) {
        (Some(bytes), Some(end), Ok(count)) if end <= has as u64 => Ok(Records {
            bytes,
            stride: stride as usize,
            size,
            count,
            form,
        }),
        _ => refuse(format!(
            "{} records from byte {}, {stride} bytes apart, but buffer view {view_number} has {has} bytes",
            accessor.count, accessor.byte_offset
        )),
    }
}
