//! Errors of clouds.

use thiserror::Error;

/// A cloud whose layout or times cannot be read.
#[derive(Clone, Debug, PartialEq, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum CloudError {
    /// More points than the limit.
    #[error(
        "cloud of {points} points is over the limit of {max_points}; raise the limit if it is real"
    )]
    TooManyPoints { points: u64, max_points: usize },
    /// Points of no bytes.
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
    /// More fields than any sensor has.
    #[error("cloud declares {fields} fields, more than {max_fields}")]
    TooManyFields { fields: usize, max_fields: usize },
    /// A datatype code that PointField does not define.
    #[error(
        "field '{field}' has datatype {datatype}, not one of 1 to 11 (INT8 to FLOAT64; INT64, UINT64, BOOL)"
    )]
    UnknownDatatype { field: String, datatype: u8 },
    /// A field of no elements.
    #[error("field '{field}' has count 0, a scalar has 1")]
    CountZero { field: String },
    /// A field that ends beyond its point.
    #[error("field '{field}' ends at byte {end} of a point of {point_step} bytes")]
    BeyondPoint {
        field: String,
        end: u64,
        point_step: u32,
    },
    /// Two fields of one name.
    #[error("field '{field}' is declared twice")]
    Duplicate { field: String },
    /// A coordinate is not there.
    #[error("cloud has no field '{field}'; its fields are {present}")]
    MissingField {
        field: &'static str,
        present: String,
    },
    /// A coordinate is an array.
    #[error("field '{field}' has count {count}, a coordinate has 1")]
    CoordinateCount { field: &'static str, count: u32 },
    /// The coordinates are integers, or of different types.
    #[error("x, y, z are {x}, {y}, {z}; they must be all FLOAT32 or all FLOAT64")]
    CoordinateTypes {
        x: &'static str,
        y: &'static str,
        z: &'static str,
    },
    /// The time field asked for is not there.
    #[error("cloud has no time field '{field}'; its fields are {present}: correct `time.field`")]
    MissingTimeField { field: String, present: String },
    /// The time field asked for has a type whose unit cannot be guessed.
    #[error(
        "time field '{field}' is {datatype}[{count}], whose unit is not known: set `time.unit` for a scalar, or another `time.field`"
    )]
    TimeType {
        field: String,
        datatype: &'static str,
        count: u32,
    },
    /// The times of one cloud spread too far.
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
    /// Offsets that lead too far from the stamp.
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
    /// Absolute times of another clock than the stamp's.
    #[error(
        "times of field '{field}' read as absolute {unit} are {distance_s} s from the stamp: synchronise the sensor (37 s is TAI, 18 s is GPS time), or set `time.reference` to stamp_start or stamp_end, or to absolute to insist"
    )]
    TimeClock {
        field: String,
        unit: &'static str,
        distance_s: f64,
    },
}

/// A unit in which times would make a cloud of plausible duration.
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
