//! Time of each point: field, unit and reference.

use rayon::prelude::*;

use super::error::FittingUnit;
use super::layout::shown;
use super::time_field::{TimeField, candidates};
use super::{CloudError, CloudView, Datatype, PointField, TimeOptions, TimeReference, TimeUnit};

/// Time of a point without one.
pub const NO_TIME_NS: i64 = i64::MIN;

/// Minimum number of points per task.
const MIN_TASK: usize = 8192;
/// Distance from the stamp above which an absolute time is from another clock.
const MAX_CLOCK_DISTANCE_S: f64 = 10.0;
/// Minimum duration of a sweep for the proposal of another unit, seconds.
const SHORTEST_SWEEP_S: f64 = 1.0e-3;

/// Times of the points of a cloud, with their source.
#[derive(Clone, Debug, PartialEq)]
pub struct PointTimes<'a> {
    /// Time of each point in nanoseconds since the Unix epoch, or [`NO_TIME_NS`]; `None` if no point has a time of
    /// its own.
    pub times_ns: Option<Vec<i64>>,
    /// Source of the times.
    pub source: TimeSource<'a>,
}

/// Source of the times of a cloud's points.
#[derive(Clone, Debug, PartialEq)]
pub enum TimeSource<'a> {
    /// No returns in the cloud, or times disabled.
    Nothing,
    /// No field with a known name and type.
    NoField {
        /// Names of possible time fields, for a log; empty if there are none.
        candidates: String,
    },
    /// No return with a finite time.
    NotFinite {
        /// Time field.
        field: &'a PointField,
    },
    /// Times from a field.
    Field {
        /// Time field.
        field: &'a PointField,
        /// Unit of the field.
        unit: TimeUnit,
        /// Reference of the times.
        reference: TimeReference,
        /// Duration between the earliest and the latest return, nanoseconds.
        span_ns: i64,
    },
}

/// Conversion of field values to times.
struct Clock<'a> {
    field: &'a PointField,
    unit: TimeUnit,
    reference: TimeReference,
    /// Time of the value zero, nanoseconds since the epoch.
    zero_ns: i64,
    /// Earliest and latest time of the field, nanoseconds.
    range_ns: (i64, i64),
}

impl<'a> CloudView<'a> {
    /// Determines the time of every point.
    ///
    /// Without options, the field is one named `time`, `t`, `timestamp` or similar:
    /// - `f32`: seconds from the stamp
    /// - 32-bit integer: nanoseconds from the stamp
    /// - `f64`: seconds; 64-bit integer: nanoseconds; from the stamp, or, by their magnitude, s, ms, us or ns from
    ///   the epoch
    /// - a suffix `_s`, `_ms`, `_us` or `_ns` states the unit
    ///
    /// Points that are not finite or lie in the origin of the sensor are not returns. Their times are ignored by the
    /// checks. They have no time if it is outside the range of the others, as do times apart from those of most
    /// returns.
    pub fn point_times(
        &self,
        stamp_ns: i64,
        options: &TimeOptions,
    ) -> Result<PointTimes<'a>, CloudError> {
        let without = |source| PointTimes {
            times_ns: None,
            source,
        };
        if self.is_empty() || options.field.as_deref() == Some("") {
            return Ok(without(TimeSource::Nothing));
        }
        let Some(field) = TimeField::of(self, options)? else {
            let candidates = candidates(self.fields());
            return Ok(without(TimeSource::NoField { candidates }));
        };
        let Some(clock) = self.clock(&field, stamp_ns, options)? else {
            let field = field.field;
            let has_return = (0..self.len()).any(|i| is_return(&self.xyz(i)));
            return Ok(without(match has_return {
                true => TimeSource::NotFinite { field },
                false => TimeSource::Nothing,
            }));
        };
        let (earliest_ns, latest_ns) = clock.range_ns;
        let value_of = self.scalars(clock.field);
        let times = (0..self.len())
            .into_par_iter()
            .with_min_len(MIN_TASK)
            .map(|i| match to_ns(value_of(self.record(i)), clock.unit) {
                Some(ns) if (earliest_ns..=latest_ns).contains(&ns) => {
                    clock.zero_ns.saturating_add(ns)
                }
                _ => NO_TIME_NS,
            })
            .collect();
        Ok(PointTimes {
            times_ns: Some(times),
            source: TimeSource::Field {
                field: clock.field,
                unit: clock.unit,
                reference: clock.reference,
                span_ns: latest_ns.saturating_sub(earliest_ns),
            },
        })
    }

    fn clock(
        &self,
        field: &TimeField<'a>,
        stamp_ns: i64,
        options: &TimeOptions,
    ) -> Result<Option<Clock<'a>>, CloudError> {
        let Some(range) = self.value_range(field.field) else {
            return Ok(None);
        };
        let all = Clock::new(field, range, range.1, stamp_ns, options);
        let Err(error) = all else {
            return all.map(Some);
        };
        // A few values may be outliers.
        let most = self.range_of_most(field, options);
        let clock = most
            .and_then(|(range, middle)| Clock::new(field, range, middle, stamp_ns, options).ok());
        clock.map(Some).ok_or(error)
    }

    /// Reader of `field` in a record; NaN if it is missing.
    fn scalars(&self, field: &PointField) -> impl Fn(&[u8]) -> f64 + Sync {
        let datatype = Datatype::from_code(field.datatype).filter(|_| field.count > 0);
        let offset = field.offset as usize;
        move |record| {
            datatype.map_or(f64::NAN, |datatype| {
                self.number_of(record, datatype, offset)
            })
        }
    }

    /// Minimum and maximum of `field` over the returns; `None` if there are none.
    fn value_range(&self, field: &PointField) -> Option<(f64, f64)> {
        let value_of = self.scalars(field);
        (0..self.len())
            .into_par_iter()
            .with_min_len(MIN_TASK)
            .filter_map(|i| {
                let record = self.record(i);
                let value = value_of(record);
                (value.is_finite() && is_return(&self.xyz_of(record))).then_some((value, value))
            })
            .reduce_with(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    /// Range of the values of `field` within the maximum duration about their median, and the median; `None` unless
    /// it contains most returns.
    fn range_of_most(
        &self,
        field: &TimeField<'a>,
        options: &TimeOptions,
    ) -> Option<((f64, f64), f64)> {
        let returns = (0..self.len()).filter(|&i| is_return(&self.xyz(i)));
        let values = returns.map(|i| self.scalar(field.field, i));
        let mut values: Vec<f64> = values.filter(|v| v.is_finite()).collect();
        let half = values.len() / 2;
        let middle = values
            .get(half)
            .is_some()
            .then(|| *values.select_nth_unstable_by(half, f64::total_cmp).1)?;
        let (unit, _) = field.guess(middle, options).ok()?;
        let width = options.max_span_s * 1e9 / unit.scale_ns() as f64;
        let near = values.iter().filter(|v| (**v - middle).abs() <= width);
        let (count, least, greatest) = near.fold((0, middle, middle), |(n, a, b), v| {
            (n + 1, v.min(a), v.max(b))
        });
        (2 * count > values.len()).then_some(((least, greatest), middle))
    }
}

impl<'a> Clock<'a> {
    /// Creates the conversion for values from `range.0` to `range.1`; `value` is one of them.
    fn new(
        field: &TimeField<'a>,
        range: (f64, f64),
        value: f64,
        stamp_ns: i64,
        options: &TimeOptions,
    ) -> Result<Self, CloudError> {
        let (unit, reference) = field.guess(value, options)?;
        let field = field.field;
        let earliest_ns = to_ns(range.0, unit).unwrap_or(NO_TIME_NS);
        let latest_ns = to_ns(range.1, unit).unwrap_or(NO_TIME_NS);
        let span_s = seconds_between(earliest_ns, latest_ns);
        let max_span_s = options.max_span_s;
        let fitting = || fitting_unit(range.1 - range.0, unit, max_span_s);
        if !(0.0..max_span_s).contains(&span_s) {
            return Err(CloudError::TimeSpan {
                field: shown(&field.name),
                unit: unit.name(),
                span_s,
                max_span_s,
                fitting: fitting(),
            });
        }
        let zero_ns = match reference {
            TimeReference::Absolute => {
                let distance_s = seconds_between(stamp_ns, earliest_ns);
                if options.reference.is_none() && distance_s.abs() > MAX_CLOCK_DISTANCE_S {
                    return Err(CloudError::TimeClock {
                        field: shown(&field.name),
                        unit: unit.name(),
                        distance_s,
                    });
                }
                0
            }
            TimeReference::StampStart => {
                let far_ns = if latest_ns.saturating_add(earliest_ns) < 0 {
                    earliest_ns
                } else {
                    latest_ns
                };
                let offset_s = seconds_between(0, far_ns);
                if offset_s.abs() <= max_span_s {
                    stamp_ns
                } else if options.reference.is_some() {
                    stamp_ns.saturating_sub(earliest_ns)
                } else {
                    return Err(CloudError::TimeOffset {
                        field: shown(&field.name),
                        unit: unit.name(),
                        offset_s,
                        max_span_s,
                        fitting: fitting(),
                    });
                }
            }
            TimeReference::StampEnd => stamp_ns.saturating_sub(latest_ns),
        };
        Ok(Self {
            field,
            unit,
            reference,
            zero_ns,
            range_ns: (earliest_ns, latest_ns),
        })
    }
}

/// Coarsest unit other than `unit` in which `span` is a plausible duration.
pub(super) fn fitting_unit(span: f64, unit: TimeUnit, max_span_s: f64) -> Option<FittingUnit> {
    let spans = TimeUnit::ALL.into_iter().filter(|u| *u != unit);
    let mut spans = spans.map(|unit| FittingUnit {
        unit: unit.name(),
        span_s: span * unit.scale_ns() as f64 * 1e-9,
    });
    spans.find(|fitting| (SHORTEST_SWEEP_S..max_span_s).contains(&fitting.span_s))
}

/// Tests whether a point is a return: finite and not in the origin of the sensor.
fn is_return(p: &nalgebra::Vector3<f64>) -> bool {
    p.iter().all(|v| v.is_finite()) && p.iter().any(|v| *v != 0.0)
}

/// Converts to nanoseconds, rounded and saturating; `None` if not finite.
fn to_ns(value: f64, unit: TimeUnit) -> Option<i64> {
    if !value.is_finite() {
        return None;
    }
    let scale = unit.scale_ns();
    // Casts truncate and saturate; without SSE4.1 `trunc` and `round` are function calls.
    let whole = value as i64;
    let rest = (value - whole as f64) * scale as f64;
    let rest_ns = rest as i64;
    let beyond = rest - rest_ns as f64;
    let up = i64::from(beyond >= 0.5) - i64::from(beyond <= -0.5);
    Some(
        whole
            .saturating_mul(scale)
            .saturating_add(rest_ns.saturating_add(up)),
    )
}

fn seconds_between(from_ns: i64, to_ns: i64) -> f64 {
    (i128::from(to_ns) - i128::from(from_ns)) as f64 * 1.0e-9
}
