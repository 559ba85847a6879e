//! `lattice paper calibration`: Nakamura et al., computed anew.

use super::{ReportOptions, make};
use crate::CliResult;
use crate::lab::processors;
use clap::Args;
use lattice_lab::paper::calibration::{Options, run};
use std::path::PathBuf;

/// Options of `lattice paper calibration`.
#[derive(Args)]
pub struct Calibration {
    #[command(flatten)]
    report: ReportOptions,
    /// Fewer trials, in less than a minute
    #[arg(long)]
    quick: bool,
    /// PLY of a house, metres, z up, with `label` and `instance` of each face [default: a house of our own]
    #[arg(long, value_name = "PLY", requires = "classes")]
    mesh: Option<PathBuf>,
    /// YAML with the names of its classes
    #[arg(long, value_name = "YAML", requires = "mesh")]
    classes: Option<PathBuf>,
    /// Folder of `lattice evaluate calibration` whose trials are taken; without it they are run
    #[arg(long, value_name = "DIR")]
    results: Option<PathBuf>,
    /// Trials at once [default: as many as processors]
    #[arg(long)]
    threads: Option<usize>,
}

impl Calibration {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        let options = Options {
            seed: self.report.seed,
            quick: self.quick,
            mesh: self.mesh.zip(self.classes),
            results: self.results,
            threads: self.threads.unwrap_or_else(processors).clamp(1, 1024),
        };
        make(&self.report, |progress| run(&options, progress))
    }
}
