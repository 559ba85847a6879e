//! Errors of clouds.

use thiserror::Error;

/// A cloud whose layout or times cannot be read.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum CloudError {
    /// More points than the limit.
    #[error(
        "cloud of {points} points is over the limit of {max_points}; raise the limit if it is real"
    )]
    TooManyPoints {
        /// `width * height`.
        points: u64,
        /// The limit.
        max_points: usize,
    },
    /// Points of no bytes.
    #[error("point_step is 0 but the cloud has {points} points")]
    PointStep {
        /// `width * height`.
        points: u64,
    },
    /// A row is shorter than its points.
    #[error(
        "row_step {row_step} is shorter than width {width} * point_step {point_step} = {needed} bytes"
    )]
    RowStep {
        /// Bytes from row to row.
        row_step: u32,
        /// Points of a row.
        width: u32,
        /// Bytes from point to point.
        point_step: u32,
        /// Bytes that a row needs.
        needed: u64,
    },
    /// The data ends before the last row.
    #[error("data has {bytes} bytes, height {height} * row_step {row_step} needs {needed}")]
    ShortData {
        /// Bytes of data.
        bytes: usize,
        /// Rows.
        height: u32,
        /// Bytes from row to row.
        row_step: u32,
        /// Bytes that all rows need.
        needed: u64,
    },
    /// More fields than any sensor has.
    #[error("cloud declares {fields} fields, more than {max_fields}")]
    TooManyFields {
        /// Fields declared.
        fields: usize,
        /// The limit.
        max_fields: usize,
    },
    /// A datatype code that PointField does not define.
    #[error("field '{field}' has datatype {datatype}, not one of 1 to 8 (INT8 to FLOAT64)")]
    UnknownDatatype {
        /// Name of the field.
        field: String,
        /// Its code.
        datatype: u8,
    },
    /// A field of no elements.
    #[error("field '{field}' has count 0, a scalar has 1")]
    CountZero {
        /// Name of the field.
        field: String,
    },
    /// A field that ends beyond its point.
    #[error("field '{field}' ends at byte {end} of a point of {point_step} bytes")]
    BeyondPoint {
        /// Name of the field.
        field: String,
        /// First byte after the field.
        end: u64,
        /// Bytes from point to point.
        point_step: u32,
    },
    /// Two fields of one name.
    #[error("field '{field}' is declared twice")]
    Duplicate {
        /// Name of the field.
        field: String,
    },
    /// A coordinate is not there.
    #[error("cloud has no field '{field}'; its fields are {present}")]
    MissingField {
        /// The coordinate.
        field: &'static str,
        /// Names of the fields that are there.
        present: String,
    },
    /// A coordinate is an array.
    #[error("field '{field}' has count {count}, a coordinate has 1")]
    CoordinateCount {
        /// The coordinate.
        field: &'static str,
        /// Elements declared.
        count: u32,
    },
    /// The coordinates are integers, or of different types.
    #[error("x, y, z are {x}, {y}, {z}; they must be all FLOAT32 or all FLOAT64")]
    CoordinateTypes {
        /// Type of x.
        x: &'static str,
        /// Type of y.
        y: &'static str,
        /// Type of z.
        z: &'static str,
    },
    /// The time field asked for is not there.
    #[error("cloud has no time field '{field}'; its fields are {present}: correct time_field")]
    MissingTimeField {
        /// Name asked for.
        field: String,
        /// Names of the fields that are there.
        present: String,
    },
    /// The time field asked for has a type whose unit cannot be guessed.
    #[error(
        "time field '{field}' is {datatype}[{count}], whose unit is not known: set time_unit for a scalar, or another time_field"
    )]
    TimeType {
        /// Name of the field.
        field: String,
        /// Its type.
        datatype: &'static str,
        /// Its elements.
        count: u32,
    },
    /// The times of one cloud spread too far.
    #[error(
        "times of field '{field}' read as {unit} span {span_s} s, not within 0..{max_span_s} s: set time_unit or time_field"
    )]
    TimeSpan {
        /// Name of the field.
        field: String,
        /// Unit it was read in.
        unit: &'static str,
        /// Latest minus earliest, seconds.
        span_s: f64,
        /// The limit, seconds.
        max_span_s: f64,
    },
    /// Offsets that lead too far from the stamp.
    #[error(
        "times of field '{field}' read as {unit} from the stamp reach {offset_s} s, over {max_span_s} s: set time_unit or time_reference"
    )]
    TimeOffset {
        /// Name of the field.
        field: String,
        /// Unit it was read in.
        unit: &'static str,
        /// The largest offset from the stamp, seconds.
        offset_s: f64,
        /// The limit, seconds.
        max_span_s: f64,
    },
    /// Absolute times of another clock than the stamp's.
    #[error(
        "times of field '{field}' read as absolute {unit} are {distance_s} s from the stamp: synchronise the sensor (37 s is TAI, 18 s is GPS time), or set time_reference to stamp_start or stamp_end, or to absolute to insist"
    )]
    TimeClock {
        /// Name of the field.
        field: String,
        /// Unit it was read in.
        unit: &'static str,
        /// Earliest point minus stamp, seconds.
        distance_s: f64,
    },
}
