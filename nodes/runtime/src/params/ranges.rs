//! Readers of parameters that have a range; a value outside is refused, naming parameter and range.

use std::fmt::Debug;
use std::ops::RangeInclusive;

use super::{ParamError, Params};

impl Params {
    /// A count within `range`.
    pub fn usize_in(
        &self,
        name: &str,
        default: usize,
        range: RangeInclusive<usize>,
    ) -> Result<usize, ParamError> {
        let value = self.i64(name, i64::try_from(default).unwrap_or(i64::MAX))?;
        usize::try_from(value)
            .ok()
            .filter(|value| range.contains(value))
            .ok_or_else(|| self.outside(name, &range, *range.end() == usize::MAX))
    }

    /// A float within `range`.
    pub fn f64_in(
        &self,
        name: &str,
        default: f64,
        range: RangeInclusive<f64>,
    ) -> Result<f64, ParamError> {
        let value = self.f64(name, default)?;
        match range.contains(&value) {
            true => Ok(value),
            false => Err(self.outside(name, &range, *range.end() >= f64::MAX)),
        }
    }

    /// A text that is not empty, such as the name of a frame.
    pub fn non_empty(&self, name: &str, default: &str) -> Result<String, ParamError> {
        let text = self.string(name, default)?;
        match text.trim().is_empty() {
            true => Err(self.invalid(name, "expected a text that is not empty")),
            false => Ok(text),
        }
    }

    fn outside<T: Debug>(
        &self,
        name: &str,
        range: &RangeInclusive<T>,
        endless: bool,
    ) -> ParamError {
        let (first, last) = (range.start(), range.end());
        let problem = match endless {
            true => format!("expected {first:?} or more"),
            false => format!("expected {first:?} to {last:?}"),
        };
        self.invalid(name, problem)
    }
}

#[cfg(test)]
mod tests {
    use super::super::ParamValue;
    use super::*;

    fn params(values: &[(&str, ParamValue)]) -> Params {
        Params::from_values("/mapper", values.iter().cloned())
    }

    #[test]
    fn counts_outside_their_range_are_refused_with_name_and_range() {
        let given = params(&[
            ("threads", ParamValue::I64(100_000)),
            ("inbox_events", ParamValue::I64(0)),
            ("max_voxels", ParamValue::I64(-1)),
        ]);
        let message = |refused: Result<usize, ParamError>| refused.unwrap_err().to_string();
        assert_eq!(
            message(given.usize_in("threads", 0, 0..=256)),
            "parameter `threads` of /mapper = 100000 (from the command line): expected 0 to 256"
        );
        let events = message(given.usize_in("inbox_events", 4096, 1..=1 << 20));
        assert!(events.ends_with("= 0 (from the command line): expected 1 to 1048576"));
        let voxels = message(given.usize_in("max_voxels", 1, 1..=usize::MAX));
        assert!(voxels.ends_with("= -1 (from the command line): expected 1 or more"));
        assert_eq!(
            given.usize_in("chunk_bytes", 60_000, 1..=60_000).unwrap(),
            60_000
        );
    }

    #[test]
    fn floats_and_texts_have_ranges_too() {
        let given = params(&[
            ("min_range_m", ParamValue::F64(150.0)),
            ("rate_hz", ParamValue::F64(-0.5)),
            ("map_frame", ParamValue::String(" ".to_owned())),
        ]);
        let error = given.f64_in("min_range_m", 0.0, 0.0..=120.0).unwrap_err();
        assert!(
            error.to_string().ends_with("expected 0.0 to 120.0"),
            "{error}"
        );
        let error = given
            .f64_in("rate_hz", 1.0, 0.1..=f64::INFINITY)
            .unwrap_err();
        assert!(
            error.to_string().ends_with("expected 0.1 or more"),
            "{error}"
        );
        let error = given.non_empty("map_frame", "map").unwrap_err();
        assert!(error.to_string().contains("`map_frame`"), "{error}");
        assert_eq!(given.non_empty("base_frame", "base").unwrap(), "base");
    }
}
