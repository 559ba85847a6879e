use crate::params_file::ParamFileError;
use thiserror::Error;

/// Reason why parameters are refused.
#[derive(Debug, Error)]
pub enum ParamError {
    /// A parameter file is refused.
    #[error(transparent)]
    File(#[from] ParamFileError),
    /// The value has another type than the node asks for.
    #[error("parameter `{name}` of {node}: expected {expected}, found {found} ({origin})")]
    Type {
        /// The node's full name.
        node: String,
        /// The parameter.
        name: String,
        /// The type the node asks for, and how to write it.
        expected: &'static str,
        /// Type and value that were given.
        found: String,
        /// Where it was given.
        origin: String,
    },
    /// The value has the right type and cannot be used.
    #[error("parameter `{name}` of {node} = {value} ({origin}): {problem}")]
    Invalid {
        /// The node's full name.
        node: String,
        /// The parameter.
        name: String,
        /// The value.
        value: String,
        /// Where it was given.
        origin: String,
        /// What is wrong with it and what would be right.
        problem: String,
    },
}
