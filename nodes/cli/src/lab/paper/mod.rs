//! `lattice paper`: the papers behind this library, computed anew.

mod calibration;
mod report_options;
mod voxels;

use crate::{CliResult, init_logging};
use clap::Subcommand;
use report_options::{ReportOptions, make};

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
