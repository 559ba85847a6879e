//! Human-readable dates and durations.

/// Year, month, day, hour, minute and second (UTC) of seconds since 1970.
///
/// Uses the Gregorian calendar with years that begin in March.
pub fn utc(seconds: u64) -> [u64; 6] {
    let (days, second) = (seconds / 86_400 + 719_468, seconds % 86_400);
    let (era, day_of_era) = (days / 146_097, days % 146_097);
    let leaps = day_of_era / 1_460 - day_of_era / 36_524 + day_of_era / 146_096;
    let year_of_era = (day_of_era - leaps) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * from_march + 2) / 5 + 1;
    let month = (from_march + 2) % 12 + 1;
    let year = 400 * era + year_of_era + u64::from(month <= 2);
    [
        year,
        month,
        day,
        second / 3600,
        second / 60 % 60,
        second % 60,
    ]
}

/// ISO 8601 date and time (UTC) of ns since 1970, truncated to milliseconds.
pub fn iso_8601(ns: i64) -> String {
    // Bags have no times before 1970.
    let ns = u64::try_from(ns).unwrap_or(0);
    let [year, month, day, hour, minute, second] = utc(ns / 1_000_000_000);
    let ms = ns / 1_000_000 % 1000;
    format!("{year}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{ms:03}Z")
}

/// A duration: `3.942 s`, `2 min 05.0 s` or `1 h 00 min 07.5 s`.
pub fn duration(seconds: f64) -> String {
    if seconds < 60.0 {
        return format!("{seconds:.3} s");
    }
    // Rounded to tenths first, so that 59.96 s is not shown as 60.0.
    let tenths = (seconds * 10.0).round() as u64;
    let (minutes, rest) = (tenths / 600, (tenths % 600) as f64 / 10.0);
    match minutes / 60 {
        0 => format!("{minutes} min {rest:04.1} s"),
        hours => format!("{hours} h {:02} min {rest:04.1} s", minutes % 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_those_of_the_calendar() {
        for (seconds, date) in [
            (0, "1970-01-01T00:00:00.000Z"),
            (951_827_696, "2000-02-29T12:34:56.000Z"),
            (1_709_251_199, "2024-02-29T23:59:59.000Z"),
            (1_709_251_200, "2024-03-01T00:00:00.000Z"),
            (4_102_444_800, "2100-01-01T00:00:00.000Z"),
        ] {
            assert_eq!(iso_8601(seconds * 1_000_000_000), date);
        }
        assert_eq!(
            iso_8601(1_299_999_999_950_000_128),
            "2011-03-13T07:06:39.950Z"
        );
        assert_eq!(iso_8601(i64::MAX), "2262-04-11T23:47:16.854Z");
        assert_eq!(iso_8601(i64::MIN), "1970-01-01T00:00:00.000Z");
    }

    #[test]
    fn durations_carry_into_minutes_and_hours() {
        for (seconds, text) in [
            (0.0, "0.000 s"),
            (3.942, "3.942 s"),
            (60.0, "1 min 00.0 s"),
            (119.96, "2 min 00.0 s"),
            (125.04, "2 min 05.0 s"),
            (3599.99, "1 h 00 min 00.0 s"),
            (3607.5, "1 h 00 min 07.5 s"),
            (90_000.0, "25 h 00 min 00.0 s"),
        ] {
            assert_eq!(duration(seconds), text);
        }
    }
}
