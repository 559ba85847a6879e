//! `lattice evaluate traps`, `town`, `rooms` and `reliability`.

use super::processors;
use super::remaining::with_remaining;
use crate::CliResult;
use clap::Args;
use lattice_lab::evaluate::{
    AdversarialScene, Case, Pair, Results, RoomCase, Settings, adversarial_report,
    reliability_report, rooms_report, run_cases, settings_of, town_report,
};
use lattice_lab::{AnyError, Report, markdown, write_report};
use std::path::{Path, PathBuf};

/// Options of evaluations that consist of many trials of one method.
#[derive(Args)]
pub struct Many {
    /// Folder of the results and the report; an ended run is continued
    #[arg(long)]
    out: PathBuf,
    /// Seeds: trials of each kind
    #[arg(long, default_value_t = 30)]
    seeds: u64,
    /// First of the seeds, to measure with others than before
    #[arg(long, default_value_t = 0)]
    first_seed: u64,
    /// Only cases with this in their names, as in "wrong input/scaled" [default: all]
    #[arg(long, default_value = "", hide_default_value = true)]
    cases: String,
    /// Threads [default: as many as processors]
    #[arg(long)]
    threads: Option<usize>,
}

impl Many {
    /// Runs `lattice evaluate traps`.
    pub fn traps(self) -> CliResult {
        let settings = settings_of(AdversarialScene::CELL_SIDE_M);
        self.show(&adversarial_report(
            &self.measure(&AdversarialScene::all(), &settings)?.sorted(),
        ))
    }

    /// Runs `lattice evaluate town`.
    pub fn town(self) -> CliResult {
        let settings = settings_of(Pair::CELL_SIDE_M);
        self.show(&town_report(
            &self.measure(&Pair::all(), &settings)?.sorted(),
        ))
    }

    /// Runs the trials that the results do not have yet.
    pub fn measure<C: Case>(&self, cases: &[C], settings: &Settings) -> Result<Results, AnyError> {
        let threads = self.threads.unwrap_or_else(processors).clamp(1, 1024);
        let mut results = Results::open(&self.out, settings)?;
        let seeds = self.first_seed..self.first_seed.saturating_add(self.seeds);
        with_remaining(|told| run_cases(cases, seeds, &self.cases, &mut results, threads, told))?;
        Ok(results)
    }

    /// Writes and prints a report.
    pub fn show(&self, report: &Report) -> CliResult {
        show(report, &self.out)
    }
}

/// Options of `lattice evaluate rooms`.
#[derive(Args)]
pub struct Rooms {
    /// Rooms captured with a headset: JSON files in `captures` of npm `@iwer/sem` [default: an office of our own]
    #[arg(value_name = "CAPTURES")]
    captures: Vec<PathBuf>,
    #[command(flatten)]
    many: Many,
}

impl Rooms {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        let (cases, settings) = RoomCase::all(&self.captures)?;
        let trials = self.many.measure(&cases, &settings)?.sorted();
        self.many.show(&rooms_report(&trials))
    }
}

/// Options of `lattice evaluate reliability`.
#[derive(Args)]
pub struct Reliability {
    /// Folders of results of `lattice evaluate calibration`, `traps` and `town`
    #[arg(required = true, value_name = "RESULTS")]
    results: Vec<PathBuf>,
    /// Folder of the report
    #[arg(long)]
    out: PathBuf,
}

impl Reliability {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        let set = |folder: &PathBuf| -> Result<_, AnyError> {
            let name = folder.file_name().unwrap_or(folder.as_os_str());
            let (_, trials) = Results::read(folder)?;
            Ok((name.to_string_lossy().into_owned(), trials))
        };
        let sets: Result<Vec<_>, AnyError> = self.results.iter().map(set).collect();
        show(&reliability_report(&sets?)?, &self.out)
    }
}

/// Writes and prints a report.
pub fn show(report: &Report, out: &Path) -> CliResult {
    write_report(report, out)?;
    print!("{}", markdown(report));
    println!("\nwritten to {}", out.display());
    Ok(())
}
