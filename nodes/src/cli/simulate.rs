//! `lattice simulate`: logs of simulated machines.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

use super::progress::Progress;
use super::{CliResult, init_logging};
use crate::bag::Storage;
use crate::simulate::{BobcatOptions, BobcatSummary, write_bobcat};

/// Write the log of a simulated machine
#[derive(Subcommand)]
pub enum Simulate {
    /// A skid-steer loader on an earth-moving site: three laser scanners, one on a turntable, and
    /// an INS at 100 Hz
    Bobcat(Bobcat),
}

/// Container of a log.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum StorageName {
    Mcap,
    Sqlite3,
}

/// Options of `lattice simulate bobcat`.
#[derive(Args)]
pub struct Bobcat {
    /// Directory of the log; it gets the rosbag2 files, and `truth/` with what no sensor knows
    #[arg(long, default_value = "bobcat")]
    out: PathBuf,
    /// The same seed gives the same bytes
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Length of the log in s
    #[arg(long, default_value_t = 30.0)]
    duration: f64,
    /// Container of the messages
    #[arg(long, value_enum, default_value = "mcap")]
    storage: StorageName,
    /// Replace a log that is already there
    #[arg(long)]
    overwrite: bool,
    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
}

impl Simulate {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        init_logging();
        let Self::Bobcat(command) = self;
        let summary = bobcat(&BobcatOptions {
            seed: command.seed,
            duration_s: command.duration,
            storage: match command.storage {
                StorageName::Mcap => Storage::Mcap,
                StorageName::Sqlite3 => Storage::Sqlite3,
            },
            out: command.out,
            overwrite: command.overwrite,
        })?;
        if command.json {
            println!("{}", serde_json::to_string_pretty(&summary)?);
        } else {
            println!("{summary}");
        }
        Ok(())
    }
}

/// Writes a log behind a progress bar.
pub fn bobcat(
    options: &BobcatOptions,
) -> Result<BobcatSummary, Box<dyn std::error::Error + Send + Sync>> {
    let progress = Progress::new("simulate");
    let summary = write_bobcat(options, &mut |done| progress.set(done))?;
    progress.done();
    Ok(summary)
}
