//! Options of per-point time.

/// Unit of a time field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimeUnit {
    /// Seconds, `s`.
    Seconds,
    /// Milliseconds, `ms`.
    Milliseconds,
    /// Microseconds, `us`.
    Microseconds,
    /// Nanoseconds, `ns`.
    Nanoseconds,
}

impl TimeUnit {
    /// All units, coarsest first.
    pub const ALL: [TimeUnit; 4] = [
        TimeUnit::Seconds,
        TimeUnit::Milliseconds,
        TimeUnit::Microseconds,
        TimeUnit::Nanoseconds,
    ];

    /// Short name: `s`, `ms`, `us`, `ns`.
    pub fn name(self) -> &'static str {
        match self {
            TimeUnit::Seconds => "s",
            TimeUnit::Milliseconds => "ms",
            TimeUnit::Microseconds => "us",
            TimeUnit::Nanoseconds => "ns",
        }
    }

    /// Nanoseconds of one unit.
    pub fn scale_ns(self) -> i64 {
        match self {
            TimeUnit::Seconds => 1_000_000_000,
            TimeUnit::Milliseconds => 1_000_000,
            TimeUnit::Microseconds => 1_000,
            TimeUnit::Nanoseconds => 1,
        }
    }
}

impl TimeReference {
    /// Name in parameters.
    pub fn name(self) -> &'static str {
        match self {
            TimeReference::StampStart => "stamp_start",
            TimeReference::StampEnd => "stamp_end",
            TimeReference::Absolute => "absolute",
        }
    }
}

/// Reference of the times of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimeReference {
    /// `stamp_start`: times count from the stamp of the cloud and may be negative. Times of a free-running clock
    /// count from the earliest point, which has the stamp.
    StampStart,
    /// `stamp_end`: the latest point has the stamp of the cloud.
    StampEnd,
    /// `absolute`: times count from the Unix epoch, independent of the stamp.
    Absolute,
}

/// Overrides of the detection; by default everything is inferred from name and type.
#[derive(Clone, Debug, PartialEq)]
pub struct TimeOptions {
    /// Name of the time field; empty disables per-point time.
    pub field: Option<String>,
    /// Unit of the time field.
    pub unit: Option<TimeUnit>,
    /// Reference of the times.
    pub reference: Option<TimeReference>,
    /// Maximum duration of a cloud, seconds.
    pub max_span_s: f64,
}

impl Default for TimeOptions {
    fn default() -> TimeOptions {
        TimeOptions {
            field: None,
            unit: None,
            reference: None,
            max_span_s: 1.0,
        }
    }
}
