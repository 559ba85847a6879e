//! Texts of Zenoh errors.

/// Text of a Zenoh error, without source locations.
pub(super) fn words(error: impl ToString) -> String {
    let text = error.to_string();
    let words = text.split(" at /").next().unwrap_or_default();
    words.trim_end().to_owned()
}
