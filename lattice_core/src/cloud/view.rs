//! Reading points from validated bytes.

use nalgebra::Vector3;

use super::coordinates::Coordinates;
use super::{CloudError, CloudLayout, CloudLimits, Datatype, PointField};

/// View of a validated cloud: points by index, row by row, without copying.
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

    /// Creates a view of `points` points with a validated extent.
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

    /// Tests whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.points == 0
    }

    /// Fields of a point.
    pub fn fields(&self) -> &'a [PointField] {
        self.fields
    }

    /// Point `i` in the sensor frame, metres; NaN for missing returns or if `i` is out of range.
    #[inline]
    pub fn xyz(&self, i: usize) -> Vector3<f64> {
        self.xyz_of(self.record(i))
    }

    /// Bytes of point `i`; empty if `i` is out of range.
    #[inline]
    pub(super) fn record(&self, i: usize) -> &'a [u8] {
        let start = self.point_start(i);
        self.data.get(start..start + self.point_step).unwrap_or(&[])
    }

    /// Coordinates in a record, metres.
    #[inline]
    pub(super) fn xyz_of(&self, record: &[u8]) -> Vector3<f64> {
        let [x, y, z] = self.coordinates.offsets;
        let datatype = match self.coordinates.wide {
            true => Datatype::Float64,
            false => Datatype::Float32,
        };
        let at = |offset| self.number_of(record, datatype, offset);
        Vector3::new(at(x), at(y), at(z))
    }

    /// True if points follow each other without gaps between rows, and have consecutive little-endian `f32` coordinates.
    #[inline]
    fn is_plain(&self) -> bool {
        let [x, y, z] = self.coordinates.offsets;
        let is_consecutive = y == x + 4 && z == x + 8;
        let is_little = !self.big_endian && !self.coordinates.wide;
        is_consecutive && is_little && self.row_step == self.width * self.point_step
    }

    /// All points as stored, metres in the frame of the cloud; `None` if their coordinates are not `f32`.
    pub fn single_points(&self) -> Option<Vec<[f32; 3]>> {
        if self.coordinates.wide {
            return None;
        }
        let [at, ..] = self.coordinates.offsets;
        if self.is_plain() && self.point_step > 0 {
            let records = self.data.chunks(self.point_step).take(self.points);
            let point = |record: &[u8]| record.get(at..)?.first_chunk::<12>().map(floats);
            return records.map(point).collect();
        }
        let point = |i| <[f64; 3]>::from(self.xyz(i)).map(|v| v as f32);
        Some((0..self.points).map(point).collect())
    }

    pub(super) fn is_big_endian(&self) -> bool {
        self.big_endian
    }

    /// First element of `field` of point `i`, converted to `f64`; NaN if it is missing.
    #[inline]
    pub fn scalar(&self, field: &PointField, i: usize) -> f64 {
        self.element(field, i, 0)
    }

    /// Element `n` of `field` of point `i`, converted to `f64`; NaN if it is missing.
    #[inline]
    pub fn element(&self, field: &PointField, i: usize, n: u32) -> f64 {
        let Some(datatype) = Datatype::from_code(field.datatype).filter(|_| n < field.count) else {
            return f64::NAN;
        };
        let offset = field.offset as usize + n as usize * datatype.bytes() as usize;
        self.number_of(self.record(i), datatype, offset)
    }

    /// Number at an offset of a record, converted to `f64`; NaN if it is missing.
    #[inline]
    pub(super) fn number_of(&self, record: &[u8], datatype: Datatype, offset: usize) -> f64 {
        let is_big = self.big_endian;
        macro_rules! read {
            ($number:ty) => {
                number(record, offset, |bytes| match is_big {
                    true => <$number>::from_be_bytes(bytes),
                    false => <$number>::from_le_bytes(bytes),
                } as f64)
            };
        }
        match datatype {
            Datatype::Float32 => read!(f32),
            Datatype::Float64 => read!(f64),
            Datatype::Uint32 => read!(u32),
            Datatype::Int32 => read!(i32),
            Datatype::Uint16 => read!(u16),
            Datatype::Int16 => read!(i16),
            Datatype::Int64 => read!(i64),
            Datatype::Uint64 => read!(u64),
            Datatype::Uint8 | Datatype::Bool => read!(u8),
            Datatype::Int8 => read!(i8),
        }
    }

    /// First four bytes of `field` of point `i`, for colours packed into a float; `None` if missing or of another
    /// field.
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

    /// Offset of point `i`; beyond the data if it is out of range.
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
}

#[inline(always)]
fn floats(bytes: &[u8; 12]) -> [f32; 3] {
    let [a, b, c, d, e, f, g, h, i, j, k, l] = *bytes;
    [[a, b, c, d], [e, f, g, h], [i, j, k, l]].map(f32::from_le_bytes)
}

/// Number of `N` bytes at an offset of a record; NaN beyond its end.
#[inline]
fn number<const N: usize>(record: &[u8], offset: usize, parse: impl Fn([u8; N]) -> f64) -> f64 {
    let bytes = record
        .get(offset..)
        .and_then(|rest| rest.first_chunk::<N>());
    bytes.map_or(f64::NAN, |bytes| parse(*bytes))
}

impl CloudLayout {
    /// Validates the layout against `data` and gives access to the points.
    ///
    /// Bytes after the last row are ignored. A cloud without points is accepted with any fields, since drivers send
    /// it without them.
    pub fn view<'a>(
        &'a self,
        data: &'a [u8],
        limits: &CloudLimits,
    ) -> Result<CloudView<'a>, CloudError> {
        let points = u64::from(self.width) * u64::from(self.height);
        if points == 0 {
            return Ok(CloudView::empty());
        }
        let points = usize::try_from(points)
            .ok()
            .filter(|&n| n <= limits.max_points)
            .ok_or(CloudError::TooManyPoints {
                points,
                max_points: limits.max_points,
            })?;
        self.check_extent(data.len())?;
        self.check_fields()?;
        Ok(CloudView::new(self, data, points, self.coordinates()?))
    }
}
