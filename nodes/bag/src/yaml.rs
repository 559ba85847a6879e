//! YAML of bags from untrusted sources: nesting is bounded before parsing, whose time
//! grows with the square of the depth.

use serde::de::{DeserializeOwned, Error};

/// Limit of open brackets; rosbag2 needs four.
const MAX_DEPTH: usize = 64;

/// Parses a text, without a byte order mark.
pub(crate) fn from_text<T: DeserializeOwned>(text: &str) -> Result<T, serde_yaml::Error> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut depth = 0_usize;
    for byte in text.bytes() {
        match byte {
            b'[' | b'{' => depth += 1,
            b']' | b'}' => depth = depth.saturating_sub(1),
            _ => {}
        }
        if depth > MAX_DEPTH {
            let reason = format!("more than {MAX_DEPTH} brackets are open");
            return Err(serde_yaml::Error::custom(reason));
        }
    }
    serde_yaml::from_str(text)
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use serde_yaml::Value;

    use super::*;

    #[test]
    fn hostile_nesting_takes_no_time() {
        for open in ["[", "{", "- ", "? ", "{a: ", "[[]", "a: ", "&a ", "!!x "] {
            let start = Instant::now();
            let _ = from_text::<Value>(&open.repeat(40_000 / open.len()));
            assert!(start.elapsed().as_secs() < 5, "{open:?}");
        }
        assert!(from_text::<Value>("[{a: [1]}, {b: [2]}]").is_ok());
    }
}
