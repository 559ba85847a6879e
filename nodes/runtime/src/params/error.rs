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
        /// File, command line or default.
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
        /// File, command line or default.
        origin: String,
        /// The problem with it, and what would be right.
        problem: String,
    },
    /// The node has no such parameter.
    #[error("parameter '{name}' of {node} is unknown{origin}; {remedy}")]
    Unknown {
        /// The parameter.
        name: String,
        /// The node's name, or those of several.
        node: String,
        /// The place of a file in brackets after a space; empty: the command line.
        origin: String,
        /// The nearest name, or how to see all of them.
        remedy: String,
    },
}
