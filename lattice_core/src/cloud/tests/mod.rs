mod layout;
mod time;
mod transform;

use super::{CloudLayout, PointField};

pub(super) const F32: u8 = 7;
pub(super) const F64: u8 = 8;
pub(super) const U32: u8 = 6;

pub(super) fn field(name: &str, offset: u32, datatype: u8) -> PointField {
    PointField {
        name: name.to_owned(),
        offset,
        datatype,
        count: 1,
    }
}

/// One row of little-endian points of f32 x, y, z and, behind them, a time of 4 or 8 bytes.
pub(super) fn timed(
    name: &str,
    datatype: u8,
    points: &[[f32; 3]],
    times: &[Vec<u8>],
) -> (CloudLayout, Vec<u8>) {
    let time_bytes = times.first().map_or(0, Vec::len);
    let mut data = Vec::new();
    for (p, t) in points.iter().zip(times) {
        for v in p {
            data.extend_from_slice(&v.to_le_bytes());
        }
        data.extend_from_slice(t);
    }
    let point_step = 12 + time_bytes as u32;
    let layout = CloudLayout {
        width: points.len() as u32,
        height: 1,
        point_step,
        row_step: point_step * points.len() as u32,
        is_bigendian: false,
        fields: vec![
            field("x", 0, F32),
            field("y", 4, F32),
            field("z", 8, F32),
            field(name, 12, datatype),
        ],
    };
    (layout, data)
}
