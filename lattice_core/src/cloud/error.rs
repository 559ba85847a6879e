//! Errors of cloud layouts and times.

use thiserror::Error;

/// Reason that the layout or the times of a cloud cannot be read.
#[derive(Clone, Debug, PartialEq, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum CloudError {
    /// More points than the limit.
    #[error(
        "cloud has {points} points, above the limit of {max_points}; raise the limit if that is correct"
    )]
    TooManyPoints { points: u64, max_points: usize },
    /// Points without bytes.
    #[error("point_step is 0 but the cloud has {points} points")]
    PointStep { points: u64 },
    /// A row is shorter than its points.
    #[error(
        "row_step {row_step} is shorter than width {width} * point_step {point_step} = {needed} bytes"
    )]
    RowStep {
        row_step: u32,
        width: u32,
        point_step: u32,
        needed: u64,
    },
    /// The data ends before the last row.
    #[error("data has {bytes} bytes, {height} rows of row_step {row_step} need {needed}")]
    ShortData {
        bytes: usize,
        height: u32,
        row_step: u32,
        needed: u64,
    },
    /// More fields than the limit.
    #[error("cloud declares {fields} fields, above {max_fields}")]
    TooManyFields { fields: usize, max_fields: usize },
    /// A datatype code that PointField does not define.
    #[error(
        "field '{field}' has datatype {datatype}, not one of 1 to 11 (INT8 to FLOAT64; INT64, UINT64, BOOL)"
    )]
    UnknownDatatype { field: String, datatype: u8 },
    /// Field without elements.
    #[error("field '{field}' has count 0, a scalar has 1")]
    CountZero { field: String },
    /// Field that ends beyond its point.
    #[error("field '{field}' ends at byte {end} of a point of {point_step} bytes")]
    BeyondPoint {
        field: String,
        end: u64,
        point_step: u32,
    },
    /// Duplicate field name.
    #[error("field '{field}' is declared twice")]
    Duplicate { field: String },
    /// Missing coordinate.
    #[error("cloud has no field '{field}'; its fields are {present}")]
    MissingField {
        field: &'static str,
        present: String,
    },
    /// Coordinate that is an array.
    #[error("field '{field}' has count {count}, a coordinate has 1")]
    CoordinateCount { field: &'static str, count: u32 },
    /// Coordinates of integer or mixed types.
    #[error("x, y, z are {x}, {y}, {z}; they must be all FLOAT32 or all FLOAT64")]
    CoordinateTypes {
        x: &'static str,
        y: &'static str,
        z: &'static str,
    },
    /// Missing time field named by an option.
    #[error("cloud has no time field '{field}'; its fields are {present}: correct `time.field`")]
    MissingTimeField { field: String, present: String },
    /// Time field of a type with an unknown unit.
    #[error(
        "time field '{field}' is {datatype}[{count}], whose unit is not known: set `time.unit` for a scalar, or another `time.field`"
    )]
    TimeType {
        field: String,
        datatype: &'static str,
        count: u32,
    },
    /// Times of one cloud that span too much.
    #[error(
        "times of field '{field}' read as {unit} span {span_s} s, not within 0..{max_span_s} s (`time.max_span_s`){}",
        other_unit(fitting)
    )]
    TimeSpan {
        field: String,
        unit: &'static str,
        span_s: f64,
        max_span_s: f64,
        fitting: Option<FittingUnit>,
    },
    /// Time offsets too far from the stamp.
    #[error(
        "times of field '{field}' read as {unit} from the stamp reach {offset_s} s, over {max_span_s} s (`time.max_span_s`): set `time.reference` to stamp_start or stamp_end if they count from another instant{}",
        other_unit(fitting)
    )]
    TimeOffset {
        field: String,
        unit: &'static str,
        offset_s: f64,
        max_span_s: f64,
        fitting: Option<FittingUnit>,
    },
    /// Absolute times of another clock than that of the stamp.
    #[error(
        "times of field '{field}' read as absolute {unit} are {distance_s} s from the stamp: synchronise the sensor (37 s is TAI, 18 s is GPS time), or set `time.reference` to stamp_start or stamp_end, or to absolute to insist"
    )]
    TimeClock {
        field: String,
        unit: &'static str,
        distance_s: f64,
    },
}

/// Unit in which the times span a plausible duration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittingUnit {
    /// Value for `time.unit`.
    pub unit: &'static str,
    /// Duration of the cloud in that unit, seconds.
    pub span_s: f64,
}

fn other_unit(fitting: &Option<FittingUnit>) -> String {
    match fitting {
        Some(FittingUnit { unit, span_s }) => {
            format!("; read as {unit} they span {span_s:.6} s: set `time.unit: {unit}`")
        }
        None => "; set `time.unit` or `time.field`".to_owned(),
    }
}
