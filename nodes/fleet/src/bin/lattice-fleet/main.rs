//! The program `lattice-fleet`, which `lattice fleet` executes.

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
    /// Add map files to a folder of Parquet tables, one part each
    ToTable(table::ToTable),
    /// Write the map file of the only part of a folder, of one part, or of a merged map
    FromTable(table::FromTable),
    /// Map logs, one part for each log or slice of its time; existing parts are skipped
    Map(map::Map),
    /// Merge all parts into one map; tiles whose parts are unchanged are kept
    Merge(merge::Merge),
    /// Propose pose corrections of logs from a merged map, each with a verdict
    Align(align::Align),
    /// Show parts, tiles, damaged files, unfinished parts and tiles to merge
    Status(status::Status),
    /// Run the scheduler or an executor of a Ballista cluster
    #[cfg(feature = "ballista")]
    #[command(subcommand)]
    Serve(serve::Serve),
}

/// Runs a command. An error is printed on standard error with a non-zero exit status.
fn main() -> ExitCode {
    env_logger::Builder::from_env(env_logger::Env::default().default_filter_or("warn")).init();
    if let Err(error) = lattice_fleet::stop::handle_signals() {
        eprintln!("lattice fleet: signals cannot be handled: {error}");
        return ExitCode::FAILURE;
    }
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
    lattice_fleet::stop::wait_if_stopping();
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("lattice fleet: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Runs a future of the engine.
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
        _ => Err(format!("{text:?} is not a number above 0")),
    }
}

fn not_negative(text: &str) -> std::result::Result<f64, String> {
    match text.parse() {
        Ok(value) if value >= 0.0 && f64::is_finite(value) => Ok(value),
        _ => Err(format!("{text:?} is not a number from 0")),
    }
}
