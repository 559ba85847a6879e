//! Conversions between nanoseconds and the two-part times of ROS.

use crate::packages::builtin_interfaces::{Duration, Time};

const NS_PER_S: i64 = 1_000_000_000;

/// Whole seconds and the rest in [0, 1e9); out of the range of `i32` the nearest that fits.
fn split(ns: i64) -> (i32, u32) {
    match i32::try_from(ns.div_euclid(NS_PER_S)) {
        // The remainder is in [0, 1e9), so the cast is exact.
        Ok(sec) => (sec, ns.rem_euclid(NS_PER_S) as u32),
        Err(_) if ns < 0 => (i32::MIN, 0),
        Err(_) => (i32::MAX, (NS_PER_S - 1) as u32),
    }
}

/// Cannot overflow: |sec| <= 2^31 and nanosec < 2^32 give less than 2.2e18.
fn join(sec: i32, nanosec: u32) -> i64 {
    i64::from(sec) * NS_PER_S + i64::from(nanosec)
}

impl Time {
    /// From nanoseconds since the epoch; saturates at the ends of `sec` (1901 and 2038).
    pub fn from_ns(ns: i64) -> Self {
        let (sec, nanosec) = split(ns);
        Self { sec, nanosec }
    }

    /// Nanoseconds since the epoch; `nanosec` of 1e9 and more counts as it stands.
    pub fn to_ns(self) -> i64 {
        join(self.sec, self.nanosec)
    }
}

impl Duration {
    /// From nanoseconds; saturates at the ends of `sec` (68 years).
    pub fn from_ns(ns: i64) -> Self {
        let (sec, nanosec) = split(ns);
        Self { sec, nanosec }
    }

    /// Nanoseconds; `nanosec` of 1e9 and more counts as it stands.
    pub fn to_ns(self) -> i64 {
        join(self.sec, self.nanosec)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_may_be_negative_and_nanoseconds_not() {
        for (ns, sec, nanosec) in [
            (0, 0, 0),
            (-1, -1, 999_999_999),
            (-1_500_000_000, -2, 500_000_000),
            (1_700_000_000_123_456_789, 1_700_000_000, 123_456_789),
            (-2_147_483_648_000_000_000, i32::MIN, 0),
            (2_147_483_647_999_999_999, i32::MAX, 999_999_999),
        ] {
            assert_eq!(Time::from_ns(ns), Time { sec, nanosec });
            assert_eq!(Duration::from_ns(ns), Duration { sec, nanosec });
            assert_eq!(Time { sec, nanosec }.to_ns(), ns);
            assert_eq!(Duration { sec, nanosec }.to_ns(), ns);
        }
    }

    #[test]
    fn times_out_of_range_are_the_nearest() {
        assert_eq!(split(i64::MAX), (i32::MAX, 999_999_999));
        assert_eq!(split(i64::MIN), (i32::MIN, 0));
        assert_eq!(join(i32::MAX, u32::MAX), 2_147_483_651_294_967_295);
    }
}
