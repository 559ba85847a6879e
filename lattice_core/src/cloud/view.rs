//! Reading points from bytes that were checked.

use nalgebra::Vector3;

use super::{CloudLayout, Datatype, PointField};

/// Offsets of the coordinates in a point, and their type.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coordinates {
    pub offsets: [usize; 3],
    pub wide: bool,
}

/// A checked cloud: points by index, row after row, without copying.
#[derive(Clone, Copy, Debug)]
pub struct CloudView<'a> {
    data: &'a [u8],
    fields: &'a [PointField],
    points: usize,
    width: usize,
    point_step: usize,
    row_step: usize,
    big_endian: bool,
    coordinates: Coordinates,
}

impl<'a> CloudView<'a> {
    pub(super) fn empty() -> CloudView<'a> {
        CloudView {
            data: &[],
            fields: &[],
            points: 0,
            width: 1,
            point_step: 0,
            row_step: 0,
            big_endian: false,
            coordinates: Coordinates {
                offsets: [0; 3],
                wide: false,
            },
        }
    }

    /// View of `points` points, whose extent in `data` was checked.
    pub(super) fn new(
        layout: &'a CloudLayout,
        data: &'a [u8],
        points: usize,
        coordinates: Coordinates,
    ) -> CloudView<'a> {
        CloudView {
            data,
            fields: &layout.fields,
            points,
            width: layout.width.max(1) as usize,
            point_step: layout.point_step as usize,
            row_step: layout.row_step as usize,
            big_endian: layout.is_bigendian,
            coordinates,
        }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.points
    }

    /// True if there is no point.
    pub fn is_empty(&self) -> bool {
        self.points == 0
    }

    /// Fields of a point.
    pub fn fields(&self) -> &'a [PointField] {
        self.fields
    }

    /// Point `i` in the sensor frame, metres; NaN where the sensor says so, or where `i` is
    /// not below [`CloudView::len`].
    #[inline]
    pub fn xyz(&self, i: usize) -> Vector3<f64> {
        let start = self.point_start(i);
        let [x, y, z] = self.coordinates.offsets;
        if self.coordinates.wide {
            Vector3::new(
                self.f64_at(start, x),
                self.f64_at(start, y),
                self.f64_at(start, z),
            )
        } else {
            Vector3::new(
                self.f32_at(start, x),
                self.f32_at(start, y),
                self.f32_at(start, z),
            )
        }
    }

    /// First element of `field` of point `i`, widened; NaN if it is not there.
    #[inline]
    pub fn scalar(&self, field: &PointField, i: usize) -> f64 {
        self.element(field, i, 0)
    }

    /// Element `n` of `field` of point `i`, widened; NaN if it is not there.
    #[inline]
    pub fn element(&self, field: &PointField, i: usize, n: u32) -> f64 {
        let start = self.point_start(i);
        let datatype = Datatype::from_code(field.datatype);
        let Some(width) = datatype.filter(|_| n < field.count).map(Datatype::bytes) else {
            return f64::NAN;
        };
        let offset = field.offset as usize + n as usize * width as usize;
        match Datatype::from_code(field.datatype) {
            Some(Datatype::Float32) => self.f32_at(start, offset),
            Some(Datatype::Float64) => self.f64_at(start, offset),
            Some(Datatype::Uint32) => self.read(start, offset, |b| u32::from_be_bytes(b).into()),
            Some(Datatype::Int32) => self.read(start, offset, |b| i32::from_be_bytes(b).into()),
            Some(Datatype::Uint16) => self.read(start, offset, |b| u16::from_be_bytes(b).into()),
            Some(Datatype::Int16) => self.read(start, offset, |b| i16::from_be_bytes(b).into()),
            Some(Datatype::Int64) => self.read(start, offset, |b| i64::from_be_bytes(b) as f64),
            Some(Datatype::Uint64) => self.read(start, offset, |b| u64::from_be_bytes(b) as f64),
            Some(Datatype::Uint8 | Datatype::Bool) => {
                self.read(start, offset, |b| u8::from_be_bytes(b).into())
            }
            Some(Datatype::Int8) => self.read(start, offset, |b| i8::from_be_bytes(b).into()),
            None => f64::NAN,
        }
    }

    /// The first four bytes of `field` of point `i` as they are, as colours are packed into a float;
    /// none if they are not there or belong to another field.
    #[inline]
    pub fn packed(&self, field: &PointField, i: usize) -> Option<u32> {
        let width = Datatype::from_code(field.datatype)?.bytes();
        let start = self.point_start(i).saturating_add(field.offset as usize);
        let bytes = self.data.get(start..)?.first_chunk::<4>()?;
        (width == 4).then(|| match self.big_endian {
            true => u32::from_be_bytes(*bytes),
            false => u32::from_le_bytes(*bytes),
        })
    }

    /// Appends all elements of `field` of point `i`, little endian; zeros if there is no such
    /// point, nothing if there is no such field.
    pub fn copy_field(&self, field: &PointField, i: usize, out: &mut Vec<u8>) {
        let Some(width) = Datatype::from_code(field.datatype).map(Datatype::bytes) else {
            return;
        };
        let width = width as usize;
        let bytes = (field.count as usize).saturating_mul(width);
        if bytes > self.point_step {
            return;
        }
        let start = self.point_start(i).saturating_add(field.offset as usize);
        let there = self.data.get(start..start.saturating_add(bytes));
        let first = out.len();
        match there {
            Some(elements) => out.extend_from_slice(elements),
            None => out.resize(first + bytes, 0),
        }
        if self.big_endian
            && let Some(new) = out.get_mut(first..)
        {
            new.chunks_exact_mut(width).for_each(<[u8]>::reverse);
        }
    }

    /// First byte of point `i`, beyond the data if there is no such point.
    #[inline]
    fn point_start(&self, i: usize) -> usize {
        if i >= self.points {
            self.data.len()
        } else if self.row_step == self.width * self.point_step {
            i * self.point_step
        } else {
            (i / self.width) * self.row_step + (i % self.width) * self.point_step
        }
    }

    #[inline]
    fn f32_at(&self, start: usize, offset: usize) -> f64 {
        self.read(start, offset, |b| f32::from_be_bytes(b).into())
    }

    #[inline]
    fn f64_at(&self, start: usize, offset: usize) -> f64 {
        self.read(start, offset, f64::from_be_bytes)
    }

    /// The value of `N` bytes, brought to big endian for `parse`; NaN beyond the data.
    #[inline]
    fn read<const N: usize>(
        &self,
        start: usize,
        offset: usize,
        parse: impl Fn([u8; N]) -> f64,
    ) -> f64 {
        let Some(mut bytes) = self
            .data
            .get(start.saturating_add(offset)..)
            .and_then(|rest| rest.first_chunk::<N>())
            .copied()
        else {
            return f64::NAN;
        };
        if !self.big_endian {
            bytes.reverse();
        }
        parse(bytes)
    }
}
