//! The program `lattice-fleet`, which `lattice fleet` runs.

mod align;
mod map;
mod merge;
mod progress;
#[cfg(feature = "ballista")]
mod serve;
mod status;
mod table;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use lattice_fleet::Result;

/// Maps as tables, and one map of many logs and robots
#[derive(Parser)]
#[command(name = "lattice fleet", version, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Add map files to a folder of Parquet tables, a part each
    ToTable(table::ToTable),
    /// One map file of a folder of tables: of its only part, of one part, or of a merged map
    FromTable(table::FromTable),
    /// Map logs, a part for each or for each slice of its time; what is there already is left out
    Map(map::Map),
    /// One map of all parts; tiles whose parts are as before are kept
    Merge(merge::Merge),
    /// Propose a correction of the poses of logs by a merged map, each with a verdict
    Align(align::Align),
    /// Parts, tiles and what is damaged, left over or not merged yet
    Status(status::Status),
    /// Be the scheduler or an executor of a Ballista cluster
    #[cfg(feature = "ballista")]
    #[command(subcommand)]
    Serve(serve::Serve),
}

/// Errors are one line on standard error and a non-zero status.
fn main() -> ExitCode {
    env_logger::Builder::from_env(env_logger::Env::default().default_filter_or("warn")).init();
    let result = match Cli::parse().command {
        Command::ToTable(command) => command.run(),
        Command::FromTable(command) => command.run(),
        Command::Map(command) => command.run(),
        Command::Merge(command) => command.run(),
        Command::Align(command) => command.run(),
        Command::Status(command) => command.run(),
        #[cfg(feature = "ballista")]
        Command::Serve(command) => command.run(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("lattice fleet: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Runs what waits for the engine.
fn block_on<T>(threads: usize, work: impl Future<Output = Result<T>>) -> Result<T> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(threads.max(1))
        .enable_all()
        .build()?;
    runtime.block_on(work)
}

/// Number of cores, for options that are not given.
fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// The program `lattice`: as given, beside this one, or on the PATH.
fn program_lattice(given: Option<PathBuf>) -> PathBuf {
    let beside = || {
        let path = std::env::current_exe().ok()?.with_file_name("lattice");
        path.is_file().then_some(path)
    };
    given.or_else(beside).unwrap_or_else(|| "lattice".into())
}

fn positive(text: &str) -> std::result::Result<f64, String> {
    match not_negative(text) {
        Ok(value) if value > 0.0 => Ok(value),
        _ => Err("a number above 0 is needed".to_owned()),
    }
}

fn not_negative(text: &str) -> std::result::Result<f64, String> {
    match text.parse() {
        Ok(value) if value >= 0.0 && f64::is_finite(value) => Ok(value),
        _ => Err("a number of at least 0 is needed".to_owned()),
    }
}
