//! Options of reports.

use std::path::PathBuf;

use clap::Args;
use lattice_lab::{Report, write_report};

use crate::CliResult;
use crate::progress::Progress;

/// Options of both papers.
#[derive(Args)]
pub(super) struct ReportOptions {
    /// Folder of the report: report.html, report.json, a CSV for each table, an SVG for each figure
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// The same seed gives the same bytes
    #[arg(long, default_value_t = 1)]
    pub(super) seed: u64,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

/// Computes a report behind a progress bar, writes it and says how each section stands.
pub(super) fn make<E: std::fmt::Display>(
    options: &ReportOptions,
    compute: impl FnOnce(&mut dyn FnMut(f64, &str)) -> Result<Report, E>,
) -> CliResult {
    let bar = Progress::new("paper");
    let report = compute(&mut |done, what| {
        bar.set(done);
        bar.say(what);
    });
    bar.done();
    let report = report.map_err(|e| e.to_string())?;
    write_report(&report, &options.out)?;
    if options.json {
        println!("{}", serde_json::to_string_pretty(&report)?);
        return Ok(());
    }
    for section in report.sections() {
        println!("{:<68} {}", section.title, section.verdict.name());
    }
    for (section, check) in report.failing() {
        println!("fails: {}: {}", section.id, check.name);
    }
    println!("written to {}", options.out.join("report.html").display());
    Ok(())
}
