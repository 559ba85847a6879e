//! Records of a transformed cloud: coordinates, copied fields, viewpoint.

use nalgebra::Vector3;

use super::{CloudView, Datatype, PointField};

/// Field names of the viewpoint: the position of the sensor when it measured the point, in the frame of the cloud.
pub const VIEWPOINT_FIELDS: [&str; 3] = ["vp_x", "vp_y", "vp_z"];

/// Coordinate below which single precision rounds by less than 0.5 mm, metres.
const SINGLE_REACH_M: f64 = 16_384.0;

/// Type of coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// `f32`, 12 bytes per point; rounds by 4 um at 64 m from the map origin, 4 mm at 64 km.
    Float32,
    /// `f64`, 24 bytes per point; exact anywhere, but RViz does not display it.
    Float64,
}

impl Precision {
    /// Single precision if it rounds a point by less than 0.5 mm, else double.
    #[inline]
    pub fn for_point(point_m: &Vector3<f64>) -> Self {
        Self::of(!point_m.iter().all(|v| v.abs() < SINGLE_REACH_M))
    }

    #[inline]
    pub(super) fn of(is_double: bool) -> Self {
        match is_double {
            true => Self::Float64,
            false => Self::Float32,
        }
    }

    /// Type of a field of this precision.
    pub fn datatype(self) -> Datatype {
        match self {
            Self::Float32 => Datatype::Float32,
            Self::Float64 => Datatype::Float64,
        }
    }
}

/// Layout of a record, little endian and without padding: `x y z`, the copied fields, and optionally
/// `vp_x vp_y vp_z`.
#[derive(Clone, Debug)]
pub struct RecordFormat {
    /// Copied fields of the cloud.
    pub(super) copied: Vec<PointField>,
    pub(super) precision: Option<Precision>,
    pub(super) with_viewpoints: bool,
}

impl RecordFormat {
    /// Creates the format for a cloud, with copies of its fields in the given list.
    ///
    /// Coordinates have `precision`; `None` selects single precision unless it rounds a point by 0.5 mm or more.
    pub fn new(
        view: &CloudView<'_>,
        names: &[String],
        precision: Option<Precision>,
        with_viewpoints: bool,
    ) -> Self {
        let mut copied: Vec<PointField> = Vec::new();
        for name in names {
            let field = view.fields().iter().find(|f| f.name == *name);
            copied.extend(field.filter(|f| !copied.contains(f)).cloned());
        }
        Self {
            copied,
            precision,
            with_viewpoints,
        }
    }

    /// Fields of a record with their offsets, and the size of a record in bytes.
    pub fn fields(&self, precision: Precision) -> (Vec<PointField>, usize) {
        let of_precision = |name: &str| PointField {
            name: name.to_owned(),
            offset: 0,
            datatype: precision.datatype() as u8,
            count: 1,
        };
        let mut fields: Vec<_> = ["x", "y", "z"].map(of_precision).into();
        fields.extend_from_slice(&self.copied);
        if self.with_viewpoints {
            fields.extend(VIEWPOINT_FIELDS.map(of_precision));
        }
        let mut bytes = 0_u32;
        for field in &mut fields {
            field.offset = bytes;
            let width = Datatype::from_code(field.datatype).map_or(0, Datatype::bytes);
            bytes = bytes.saturating_add(field.count.saturating_mul(width));
        }
        (fields, bytes as usize)
    }
}

/// Copy of fields from a cloud record to a little-endian record.
pub(super) struct Copies {
    /// Byte range in the source, and the width of the elements.
    parts: Vec<(std::ops::Range<usize>, usize)>,
    is_big_endian: bool,
}

impl Copies {
    pub fn new(view: &CloudView<'_>, fields: &[PointField]) -> Self {
        let part = |field: &PointField| {
            let width = Datatype::from_code(field.datatype).map_or(0, Datatype::bytes) as usize;
            let first = field.offset as usize;
            let bytes = (field.count as usize).saturating_mul(width);
            (first..first.saturating_add(bytes), width.max(1))
        };
        Self {
            parts: fields.iter().map(part).collect(),
            is_big_endian: view.is_big_endian(),
        }
    }

    /// Writes the fields of a source record to the start of `out`; returns the remainder.
    #[inline]
    pub fn write<'a>(&self, record: &[u8], mut out: &'a mut [u8]) -> &'a mut [u8] {
        for (source, width) in &self.parts {
            let Some(bytes) = record.get(source.clone()) else {
                break;
            };
            let Some((place, rest)) = out.split_at_mut_checked(bytes.len()) else {
                return &mut [];
            };
            place.copy_from_slice(bytes);
            if self.is_big_endian {
                place.chunks_exact_mut(*width).for_each(<[u8]>::reverse);
            }
            out = rest;
        }
        out
    }
}

/// Writes three coordinates to the start of `out`; returns the remainder.
#[inline]
pub(super) fn write_vector<'a, const IS_WIDE: bool>(
    v: &Vector3<f64>,
    out: &'a mut [u8],
) -> &'a mut [u8] {
    let size = if IS_WIDE { 8 } else { 4 };
    let Some((place, rest)) = out.split_at_mut_checked(3 * size) else {
        return &mut [];
    };
    for (value, place) in v.iter().zip(place.chunks_exact_mut(size)) {
        if IS_WIDE {
            place.copy_from_slice(&value.to_le_bytes());
        } else {
            place.copy_from_slice(&(*value as f32).to_le_bytes());
        }
    }
    rest
}
