//! Ranges of options.

use crate::AnyError;

/// Checks that an option is in its range; NaN never is.
pub fn within(name: &str, value: f64, least: f64, most: f64) -> Result<(), AnyError> {
    match (least..=most).contains(&value) {
        true => Ok(()),
        false => Err(format!("{name} is {value}, not within {least} to {most}").into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ends_are_taken_and_nothing_beyond_them() {
        for value in [1.0, 1.5, 2.0] {
            assert!(within("depth", value, 1.0, 2.0).is_ok());
        }
        for value in [0.999, 2.001, f64::NAN, f64::INFINITY] {
            assert!(within("depth", value, 1.0, 2.0).is_err());
        }
        let refused = within("depth", 3.0, 1.0, 2.0).unwrap_err();
        assert_eq!(refused.to_string(), "depth is 3, not within 1 to 2");
    }
}
