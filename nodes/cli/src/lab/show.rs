//! Output of a report.

use std::fmt::Display;

use serde::Serialize;

use crate::CliResult;

/// Prints a summary, as JSON if that is asked for.
pub(super) fn show(json: bool, summary: &(impl Serialize + Display)) -> CliResult {
    match json {
        true => println!("{}", serde_json::to_string_pretty(summary)?),
        false => println!("{summary}"),
    }
    Ok(())
}
