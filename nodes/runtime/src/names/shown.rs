/// Longest part of an argument that a message repeats, characters.
const SHOWN_MAX: usize = 160;

/// `text` with control characters escaped, cut where it is too long for a message.
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
