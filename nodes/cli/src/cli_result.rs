//! Result of a command.

use std::error::Error;

/// Result of a command, with any error for the user.
pub(crate) type CliResult<T = ()> = Result<T, Box<dyn Error + Send + Sync>>;
