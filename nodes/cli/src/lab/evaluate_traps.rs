//! `lattice evaluate traps`.

use super::evaluate::Remaining;
use super::processors;
use crate::CliResult;
use clap::Args;
use lattice_lab::evaluate::Results;
use lattice_lab::evaluate::traps::{run, settings, traps_report};
use lattice_lab::{markdown, write_report};
use std::path::PathBuf;

/// Options of `lattice evaluate traps`.
#[derive(Args)]
pub struct Traps {
    /// Folder of the results and the report; a run that was ended goes on where it was
    #[arg(long)]
    out: PathBuf,
    /// Trials of each trap
    #[arg(long, default_value_t = 30)]
    seeds: u64,
    /// Threads [default: as many as processors]
    #[arg(long)]
    threads: Option<usize>,
}

impl Traps {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        let threads = self.threads.unwrap_or_else(processors).clamp(1, 1024);
        let mut results = Results::open(&self.out, &settings())?;
        let bar = Remaining::new();
        let ran = run(self.seeds, &mut results, threads, &mut |done, total| {
            bar.tell(done, total);
        });
        bar.done();
        ran?;
        let report = traps_report(&results.sorted());
        write_report(&report, &self.out)?;
        print!("{}", markdown(&report));
        println!("\nwritten to {}", self.out.display());
        Ok(())
    }
}
