use crate::config::params_file::ParamFileError;
use thiserror::Error;

/// Reason for rejecting parameters.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ParamError {
    /// A parameter file is rejected.
    #[error(transparent)]
    File(#[from] ParamFileError),
    /// The value has another type than declared.
    #[error("parameter `{name}` of {node}: expected {expected}, found {found} ({origin})")]
    Type {
        /// Full name of the node.
        node: String,
        /// The parameter.
        name: String,
        /// Declared type, and how to write it.
        expected: &'static str,
        /// Type and value found.
        found: String,
        /// File, command line or default.
        origin: String,
    },
    /// The value has the declared type but is invalid.
    #[error("parameter `{name}` of {node} = {value} ({origin}): {problem}")]
    Invalid {
        /// Full name of the node.
        node: String,
        /// The parameter.
        name: String,
        /// The value.
        value: String,
        /// File, command line or default.
        origin: String,
        /// Violated rule, with the allowed values.
        problem: String,
    },
    /// The node has no such parameter.
    #[error("parameter '{name}' of {node} is unknown{origin}; {remedy}")]
    Unknown {
        /// The parameter.
        name: String,
        /// Name of the node or nodes.
        node: String,
        /// Place in a file, in parentheses after a space; empty: the command line.
        origin: String,
        /// Nearest name, or how to list all names.
        remedy: String,
    },
}
