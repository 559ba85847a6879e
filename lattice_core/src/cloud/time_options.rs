//! Settings for per-point time.

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
    /// All units, the coarsest first.
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
    /// Name as in the documentation of the variants.
    pub fn name(self) -> &'static str {
        match self {
            TimeReference::StampStart => "stamp_start",
            TimeReference::StampEnd => "stamp_end",
            TimeReference::Absolute => "absolute",
        }
    }
}

/// Instant that a time field counts from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimeReference {
    /// `stamp_start`: from the stamp of the cloud, negative before it. Times of a free
    /// running clock count from the earliest point, which then has the stamp.
    StampStart,
    /// `stamp_end`: the latest point has the stamp of the cloud.
    StampEnd,
    /// `absolute`: from the Unix epoch, whatever the stamp.
    Absolute,
}

/// Overrides of the detector; the default guesses all by name and type.
#[derive(Clone, Debug, PartialEq)]
pub struct TimeOptions {
    /// Name of the time field; empty to have no per-point time.
    pub field: Option<String>,
    /// Its unit.
    pub unit: Option<TimeUnit>,
    /// Instant that it counts from.
    pub reference: Option<TimeReference>,
    /// The times of a cloud span less than this, seconds.
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
