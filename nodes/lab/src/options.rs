//! Options and their ranges.

use thiserror::Error;

/// An option out of its range.
#[derive(Clone, Copy, PartialEq, Debug, Error)]
#[error("{name} is {value}, not within {least} to {most}")]
pub struct OutOfRange {
    /// Which option.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// Least value taken.
    pub least: f64,
    /// Greatest value taken.
    pub most: f64,
}

/// Checks that an option is in its range; NaN never is.
pub(crate) fn within(
    name: &'static str,
    value: f64,
    least: f64,
    most: f64,
) -> Result<(), OutOfRange> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(OutOfRange {
        name,
        value,
        least,
        most,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ends_are_taken_and_nothing_beyond_them() {
        for value in [1.0, 1.5, 2.0] {
            assert_eq!(within("depth", value, 1.0, 2.0), Ok(()));
        }
        for value in [0.999, 2.001, f64::NAN, f64::INFINITY] {
            assert!(within("depth", value, 1.0, 2.0).is_err());
        }
        let refused = within("depth", 3.0, 1.0, 2.0).unwrap_err();
        assert_eq!(refused.to_string(), "depth is 3, not within 1 to 2");
    }
}
