//! Time between two stamps.

/// Midpoint of two times, ns.
pub fn middle_ns(from_ns: i64, to_ns: i64) -> i64 {
    from_ns.saturating_add(to_ns.saturating_sub(from_ns) / 2)
}
