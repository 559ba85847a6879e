//! The `lattice` command.

mod bench;
mod bench_register;
mod calibrate;
mod demo;
mod evaluate;
mod evaluate_kitti;
mod map;
mod node;
mod paper;
mod progress;
mod quantize;
mod replay;
mod run;
mod simulate;

use std::error::Error;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use lattice_core::lattice::LatticeKind;

/// Any error on its way to the user.
pub type CliResult = Result<(), Box<dyn Error + Send + Sync>>;

/// Lattice voxel maps from logs and live robots.
#[derive(Parser)]
#[command(name = "lattice", version, about, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Simulate a loader at work, play its log through the nodes, show the maps of all lattices
    Demo(demo::Demo),
    /// Run several nodes in one process, as parameter files say
    Run(run::Run),
    /// Run one node, as its own executable does
    Node(node::NodeCommand),
    /// Map a rosbag2 log: directly, or played through separate node processes
    Replay(replay::Replay),
    /// Write the log, the points or the map of a simulated machine
    #[command(subcommand)]
    Simulate(simulate::Simulate),
    /// Quantize a point file (ply, pcd, xyz, KITTI bin) and show what each lattice makes of it
    Quantize(quantize::Quantize),
    /// Find where a cloud lies in a map, without a guess, and whether the answer holds
    Calibrate(calibrate::Calibrate),
    /// Measure what the algorithms are worth
    #[command(subcommand)]
    Evaluate(evaluate::Evaluate),
    /// Compute every table and figure of a paper and set it beside what is printed
    #[command(subcommand)]
    Paper(paper::Paper),
    /// Measure quantizers and stores on a raw point file
    #[command(subcommand)]
    Bench(bench::Bench),
    /// Look into map files and export them
    #[command(subcommand)]
    Map(map::Map),
}

/// Runs the command line; errors are one line on standard error and a non-zero status.
pub fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Demo(command) => command.run(),
        Command::Run(command) => command.run(),
        Command::Node(command) => command.run(),
        Command::Replay(command) => command.run(),
        Command::Simulate(command) => command.run(),
        Command::Quantize(command) => command.run(),
        Command::Calibrate(command) => command.run(),
        Command::Evaluate(command) => command.run(),
        Command::Paper(command) => command.run(),
        Command::Bench(command) => command.run(),
        Command::Map(command) => command.run(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("lattice: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Lattices by name, those of the `paper`, or `all`.
#[derive(Clone, Debug)]
pub struct Lattices(pub Vec<LatticeKind>);

impl std::str::FromStr for Lattices {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "all" => return Ok(Self(LatticeKind::ALL.to_vec())),
            "paper" => return Ok(Self(LatticeKind::PAPER.to_vec())),
            _ => {}
        }
        let kinds = text.split(',').map(|name| {
            let kind = name.trim().parse::<LatticeKind>();
            kind.map_err(|e| format!("{e}; or 'all', or 'paper' for the five of the paper"))
        });
        kinds.collect::<Result<_, _>>().map(Self)
    }
}

/// Log lines of the tools themselves; nodes have their own.
fn init_logging() {
    let env = env_logger::Env::default().default_filter_or("warn");
    // A second command in one process (tests) keeps the first logger.
    let _ = env_logger::Builder::from_env(env)
        .format_timestamp(None)
        .try_init();
}
