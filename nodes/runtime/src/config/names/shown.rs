/// Longest quoted part of an argument in a message, characters.
const SHOWN_MAX: usize = 160;

/// Escapes control characters of `text` and shortens it for a message.
pub(crate) fn shown(text: &str) -> String {
    let mut chars = text.chars();
    let mut out: String = chars
        .by_ref()
        .take(SHOWN_MAX)
        .flat_map(char::escape_debug)
        .collect();
    if chars.next().is_some() {
        out.push('…');
    }
    out
}
