use thiserror::Error;

/// Longest part of an argument that a message repeats, characters.
const SHOWN_MAX: usize = 160;

/// Why a command line was refused; every message shows the argument, what was expected and an example.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum RosArgsError {
    /// The last argument is a flag that needs a value.
    #[error(
        "`{flag}` at the end of the command line has no value; \
         expected {expected}, for example `{flag} {example}`"
    )]
    MissingValue {
        /// The flag as given.
        flag: String,
        /// What has to follow it.
        expected: &'static str,
        /// A value that would be accepted.
        example: &'static str,
    },
    /// The value of a flag does not follow the grammar.
    #[error("`{flag} {argument}`: {problem}; expected {expected}, for example `{flag} {example}`")]
    Malformed {
        /// The flag as given.
        flag: String,
        /// The value as given, escaped and shortened.
        argument: String,
        /// What is wrong with it.
        problem: String,
        /// What is accepted.
        expected: &'static str,
        /// A value that would be accepted.
        example: &'static str,
    },
}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_and_odd_arguments_stay_readable() {
        assert_eq!(shown("a\nb"), "a\\nb");
        assert_eq!(shown(&"x".repeat(1000)).chars().count(), SHOWN_MAX + 1);
    }
}
