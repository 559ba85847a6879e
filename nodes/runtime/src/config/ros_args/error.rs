use thiserror::Error;

/// Reason for rejecting a command line; the message gives the argument, the expected form and an example.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum RosArgsError {
    /// The last argument is a flag that needs a value.
    #[error(
        "`{flag}` at the end of the command line has no value; \
         expected {expected}, for example `{flag} {example}`"
    )]
    MissingValue {
        /// The flag as given.
        flag: String,
        /// Expected form of its value.
        expected: &'static str,
        /// Example of a valid value.
        example: &'static str,
    },
    /// The value of a flag is malformed.
    #[error("`{flag} {argument}`: {problem}; expected {expected}, for example `{flag} {example}`")]
    Malformed {
        /// The flag as given.
        flag: String,
        /// The value as given, escaped and shortened.
        argument: String,
        /// Violated rule of the grammar.
        problem: String,
        /// Expected form of the value.
        expected: &'static str,
        /// Example of a valid value.
        example: &'static str,
    },
}
