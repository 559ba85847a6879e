//! GPS time to UTC.

/// Start of GPS time, 1980-01-06 00:00:00 UTC, seconds since the Unix epoch.
const GPS_EPOCH_UNIX_S: i64 = 315_964_800;

const WEEK_S: i64 = 604_800;

/// Converts a GPS week (since 1980, not modulo 1024) and its milliseconds to UTC in nanoseconds since the Unix epoch.
///
/// `leap_seconds` is GPS minus UTC, 18 since 2017. Saturates after the year 2262.
pub fn utc_ns_from_gps(week: u32, week_milliseconds: u32, leap_seconds: i32) -> i64 {
    // 2^32 weeks are far below the limits of `i64` in seconds.
    let whole_s = GPS_EPOCH_UNIX_S + i64::from(week) * WEEK_S - i64::from(leap_seconds);
    whole_s
        .saturating_mul(1_000_000_000)
        .saturating_add(i64::from(week_milliseconds) * 1_000_000)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_instants() {
        assert_eq!(utc_ns_from_gps(0, 0, 0), 315_964_800_000_000_000);
        // 2017-01-01 00:00:00 UTC: the instant after the 18th leap second.
        assert_eq!(utc_ns_from_gps(1930, 18_000, 18), 1_483_228_800_000_000_000);
        // 2020-01-01 00:00:00.010 UTC, a Wednesday of week 2086.
        assert_eq!(
            utc_ns_from_gps(2086, 3 * 86_400_000 + 18_010, 18),
            1_577_836_800_010_000_000
        );
    }

    #[test]
    fn absurd_weeks_saturate() {
        assert_eq!(utc_ns_from_gps(u32::MAX, u32::MAX, 0), i64::MAX);
    }
}
