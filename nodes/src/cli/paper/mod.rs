//! `lattice paper`: the papers behind this library, computed anew.

mod calibration;
mod voxels;

use std::path::Path;

use clap::Subcommand;

use super::progress::Progress;
use super::{CliResult, init_logging};
use crate::paper::report::{self, Report};

/// Compute every table and figure of a paper and set it beside what is printed
#[derive(Subcommand)]
pub enum Paper {
    /// Ryde and Brünig 2011, lattice occupied voxel lists
    Voxels(voxels::Voxels),
    /// Nakamura et al. 2019, calibration of a headset by Semantic-ICP
    Calibration(calibration::Calibration),
}

impl Paper {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        init_logging();
        match self {
            Self::Voxels(command) => command.run(),
            Self::Calibration(command) => command.run(),
        }
    }
}

/// Computes a report behind a progress bar, writes it and says how each section stands.
fn make<E: std::fmt::Display>(
    name: &str,
    folder: &Path,
    json: bool,
    compute: impl FnOnce(&mut dyn FnMut(f64, &str)) -> Result<Report, E>,
) -> CliResult {
    let bar = Progress::new(name);
    let report = compute(&mut |done, what| {
        bar.set(done);
        bar.say(what);
    });
    bar.done();
    let report = report.map_err(|e| e.to_string())?;
    report::write(&report, folder)?;
    if json {
        println!("{}", serde_json::to_string_pretty(&report)?);
        return Ok(());
    }
    for section in report.sections() {
        println!("{:<68} {}", section.title, section.verdict.name());
    }
    for (section, check) in report.failing() {
        println!("fails: {}: {}", section.id, check.name);
    }
    println!("written to {}", folder.join("report.html").display());
    Ok(())
}
