use thiserror::Error;

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
