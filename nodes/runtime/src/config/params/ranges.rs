//! Readers for parameters with a range; the error of a value outside names parameter and range.

use std::fmt::Debug;
use std::ops::RangeInclusive;

use super::about::{Declared, Range};
use super::error::ParamError;
use super::state::Params;
use crate::sync::lock;

impl Params {
    /// Reads a count within `range`.
    pub fn usize_in(
        &self,
        name: &str,
        default: usize,
        range: RangeInclusive<usize>,
    ) -> Result<usize, ParamError> {
        let integer = |value| i64::try_from(value).unwrap_or(i64::MAX);
        let value = self.i64(name, integer(default))?;
        let bounds = Range::Integer(integer(*range.start()), integer(*range.end()));
        self.constrain(name, |declared| declared.range = Some(bounds));
        let value = usize::try_from(value).ok();
        value
            .filter(|value| range.contains(value))
            .ok_or_else(|| self.outside(name, &range, *range.end() == usize::MAX))
    }

    /// Reads a count of 0 or more.
    pub fn usize(&self, name: &str, default: usize) -> Result<usize, ParamError> {
        self.usize_in(name, default, 0..=usize::MAX)
    }

    /// Reads a count of 1 or more.
    pub fn positive(&self, name: &str, default: usize) -> Result<usize, ParamError> {
        self.usize_in(name, default, 1..=usize::MAX)
    }

    /// Reads a float within `range`.
    pub fn f64_in(
        &self,
        name: &str,
        default: f64,
        range: RangeInclusive<f64>,
    ) -> Result<f64, ParamError> {
        let value = self.f64(name, default)?;
        let bounds = Range::Float(*range.start(), range.end().min(f64::MAX));
        self.constrain(name, |declared| declared.range = Some(bounds));
        match range.contains(&value) {
            true => Ok(value),
            false => Err(self.outside(name, &range, *range.end() >= f64::MAX)),
        }
    }

    /// Reads one of some words and returns its index; the first word is the default.
    pub fn word(&self, name: &str, words: &[&str]) -> Result<usize, ParamError> {
        let default = words.first().copied().unwrap_or_default();
        self.word_or(name, words, default)
    }

    /// Reads one of some words with a given default.
    pub fn word_or(&self, name: &str, words: &[&str], default: &str) -> Result<usize, ParamError> {
        let word = self.string(name, default)?;
        let known = words.join(" or ");
        self.constrain(name, |declared| declared.allowed.clone_from(&known));
        let place = words.iter().position(|known| *known == word);
        place.ok_or_else(|| self.invalid(name, format!("{word:?}, expected {known}")))
    }

    fn constrain(&self, name: &str, change: impl FnOnce(&mut Declared)) {
        lock(&self.state).declared.get_mut(name).map(change);
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
            false => format!("expected a number from {first:?} to {last:?}"),
        };
        self.invalid(name, problem)
    }
}

#[cfg(test)]
mod tests {
    use super::super::ParamValue;
    use super::*;

    #[test]
    fn values_outside_their_range_are_refused_with_name_and_range() {
        let values = [
            ("threads", ParamValue::I64(100_000)),
            ("inbox_events", ParamValue::I64(0)),
            ("max_voxels", ParamValue::I64(-1)),
            ("min_range_m", ParamValue::F64(150.0)),
            ("rate_hz", ParamValue::F64(-0.5)),
        ];
        let given = Params::from_values("/mapper", values);
        let count = |name, range, end: &str| {
            let error = given.usize_in(name, 1, range).unwrap_err().to_string();
            assert!(error.ends_with(end), "{error}");
        };
        let origin = "of /mapper = 100000 (from the command line): expected a number from 0 to 256";
        count("threads", 0..=256, &format!("parameter `threads` {origin}"));
        count(
            "inbox_events",
            1..=1 << 20,
            "= 0 (from the command line): expected a number from 1 to 1048576",
        );
        count("max_voxels", 1..=usize::MAX, "expected 1 or more");
        let float = |name, range, end: &str| {
            let error = given.f64_in(name, 1.0, range).unwrap_err().to_string();
            assert!(error.ends_with(end), "{error}");
        };
        float(
            "min_range_m",
            0.0..=120.0,
            "expected a number from 0.0 to 120.0",
        );
        float("rate_hz", 0.1..=f64::INFINITY, "expected 0.1 or more");
        let chunk_bytes = given.usize_in("chunk_bytes", 60_000, 1..=60_000);
        assert_eq!(chunk_bytes.unwrap(), 60_000);
    }
}
