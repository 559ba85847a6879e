//! Reports of papers and evaluations: sections with tables, pictures and, for a paper, a claim and a verdict.
//!
//! A report holds no time, no path and no count of threads, so that the same seed gives the same bytes.

mod content;
mod files;
mod html;
mod markdown;
pub mod plot;

pub use content::{Cell, Check, Figure, Report, Section, Table, Verdict, numbers};
pub use files::write_report;
pub use html::escaped;
pub use markdown::markdown;

#[cfg(test)]
mod tests;
