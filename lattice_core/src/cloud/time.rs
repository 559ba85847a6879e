//! Per-point time: field, unit and the instant that it counts from.

use rayon::prelude::*;

use super::layout::{names, shown};
use super::{CloudError, CloudView, Datatype, PointField, TimeOptions, TimeReference, TimeUnit};

/// Time of a point that has none.
pub const NO_TIME_NS: i64 = i64::MIN;

/// Names that sensors give their time, the first one present wins.
const NAMES: [&str; 5] = ["time", "t", "time_stamp", "timestamp", "offset_time"];
/// Points of one task, at least.
const MIN_TASK: usize = 8192;
/// An absolute time further from the stamp is of another clock.
const MAX_CLOCK_DISTANCE_S: f64 = 10.0;
/// Least f64 values taken as absolute: 1973 in seconds, milli-, micro- and nanoseconds.
const LEAST_ABSOLUTE: [(f64, TimeUnit); 4] = [
    (1.0e17, TimeUnit::Nanoseconds),
    (1.0e14, TimeUnit::Microseconds),
    (1.0e11, TimeUnit::Milliseconds),
    (1.0e8, TimeUnit::Seconds),
];

/// Conversion of values of a field into times.
struct Clock<'a> {
    field: &'a PointField,
    unit: TimeUnit,
    /// Nanoseconds since the epoch of the value zero.
    zero_ns: i64,
    /// Earliest and latest nanoseconds of the field.
    range_ns: (i64, i64),
}

impl CloudView<'_> {
    /// Time of every point, nanoseconds since the epoch, [`NO_TIME_NS`] where it has none;
    /// `None` if the cloud has no time field.
    ///
    /// Without overrides, `time`, `t`, `time_stamp`, `timestamp` and `offset_time` count as
    /// f32 in seconds from the stamp, as u32 in nanoseconds from the stamp, and as f64 in
    /// seconds from the stamp or, by their size, in s, ms, us or ns from the epoch. Points
    /// that are not finite or lie in the sensor's origin are no returns: their times do not
    /// enter the checks, and count as none where they leave the range of the others.
    pub fn point_times(
        &self,
        stamp_ns: i64,
        options: &TimeOptions,
    ) -> Result<Option<Vec<i64>>, CloudError> {
        let Some(clock) = self.clock(stamp_ns, options)? else {
            return Ok(None);
        };
        let (earliest_ns, latest_ns) = clock.range_ns;
        let times = (0..self.len())
            .into_par_iter()
            .with_min_len(MIN_TASK)
            .map(|i| match to_ns(self.scalar(clock.field, i), clock.unit) {
                Some(ns) if (earliest_ns..=latest_ns).contains(&ns) => {
                    clock.zero_ns.saturating_add(ns)
                }
                _ => NO_TIME_NS,
            })
            .collect();
        Ok(Some(times))
    }

    fn clock(&self, stamp_ns: i64, options: &TimeOptions) -> Result<Option<Clock<'_>>, CloudError> {
        let Some((field, datatype)) = self.time_field(options)? else {
            return Ok(None);
        };
        let Some((least, greatest)) = self.value_range(field) else {
            return Ok(None);
        };
        let (unit, reference) = guess(datatype, greatest, options);
        let unit = unit.ok_or_else(|| CloudError::TimeType {
            field: shown(&field.name),
            datatype: datatype.name(),
            count: field.count,
        })?;
        let earliest_ns = to_ns(least, unit).unwrap_or(NO_TIME_NS);
        let latest_ns = to_ns(greatest, unit).unwrap_or(NO_TIME_NS);
        let span_s = seconds_between(earliest_ns, latest_ns);
        let max_span_s = options.max_span_s;
        if !(0.0..max_span_s).contains(&span_s) {
            return Err(CloudError::TimeSpan {
                field: shown(&field.name),
                unit: unit.name(),
                span_s,
                max_span_s,
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
                    });
                }
            }
            TimeReference::StampEnd => stamp_ns.saturating_sub(latest_ns),
        };
        Ok(Some(Clock {
            field,
            unit,
            zero_ns,
            range_ns: (earliest_ns, latest_ns),
        }))
    }

    fn time_field(
        &self,
        options: &TimeOptions,
    ) -> Result<Option<(&PointField, Datatype)>, CloudError> {
        let find = |name: &str| self.fields().iter().find(|f| f.name == name);
        match options.field.as_deref() {
            Some("") => Ok(None),
            _ if self.is_empty() => Ok(None),
            Some(name) => {
                let field = find(name).ok_or_else(|| CloudError::MissingTimeField {
                    field: shown(name),
                    present: names(self.fields()),
                })?;
                let datatype = Datatype::from_code(field.datatype);
                match datatype.filter(|_| field.count == 1) {
                    Some(datatype) => Ok(Some((field, datatype))),
                    None => Err(CloudError::TimeType {
                        field: shown(name),
                        datatype: datatype.map_or("unknown", Datatype::name),
                        count: field.count,
                    }),
                }
            }
            None => Ok(NAMES
                .iter()
                .filter_map(|name| find(name))
                .filter(|field| field.count == 1)
                .find_map(|field| match Datatype::from_code(field.datatype)? {
                    datatype @ (Datatype::Float32 | Datatype::Float64 | Datatype::Uint32) => {
                        Some((field, datatype))
                    }
                    datatype if options.unit.is_some() => Some((field, datatype)),
                    _ => None,
                })),
        }
    }

    /// Least and greatest value of `field` over the returns; `None` if there are none.
    fn value_range(&self, field: &PointField) -> Option<(f64, f64)> {
        (0..self.len())
            .into_par_iter()
            .with_min_len(MIN_TASK)
            .filter_map(|i| {
                let value = self.scalar(field, i);
                (value.is_finite() && is_return(&self.xyz(i))).then_some((value, value))
            })
            .reduce_with(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }
}

/// Unit and reference: what the user says, else what type and size suggest.
fn guess(
    datatype: Datatype,
    greatest: f64,
    options: &TimeOptions,
) -> (Option<TimeUnit>, TimeReference) {
    let by_size = LEAST_ABSOLUTE
        .iter()
        .find(|(least, _)| datatype == Datatype::Float64 && greatest >= *least);
    let unit = options.unit.or(match (datatype, by_size) {
        (Datatype::Float64, Some((_, unit))) => Some(*unit),
        (Datatype::Float32 | Datatype::Float64, _) => Some(TimeUnit::Seconds),
        (Datatype::Uint32, _) => Some(TimeUnit::Nanoseconds),
        _ => None,
    });
    // With a unit given, a value is absolute if that unit makes it later than 1973.
    let absolute = match options.unit {
        None => by_size.is_some(),
        Some(unit) => {
            datatype == Datatype::Float64
                && LEAST_ABSOLUTE
                    .iter()
                    .any(|(least, u)| *u == unit && greatest >= *least)
        }
    };
    let guessed = if absolute {
        TimeReference::Absolute
    } else {
        TimeReference::StampStart
    };
    (unit, options.reference.unwrap_or(guessed))
}

/// True for a point that a sensor measured: finite, and not in its own origin.
fn is_return(p: &nalgebra::Vector3<f64>) -> bool {
    p.iter().all(|v| v.is_finite()) && p.iter().any(|v| *v != 0.0)
}

/// Nanoseconds of `value` units, rounded; saturating, `None` if not finite.
fn to_ns(value: f64, unit: TimeUnit) -> Option<i64> {
    if !value.is_finite() {
        return None;
    }
    let scale = unit.scale_ns();
    let whole = value.trunc();
    let rest_ns = ((value - whole) * scale as f64).round() as i64;
    Some((whole as i64).saturating_mul(scale).saturating_add(rest_ns))
}

fn seconds_between(from_ns: i64, to_ns: i64) -> f64 {
    (i128::from(to_ns) - i128::from(from_ns)) as f64 * 1.0e-9
}
