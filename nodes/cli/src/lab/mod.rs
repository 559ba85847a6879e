//! The commands of the laboratory: simulation, papers, evaluations, benchmarks.

mod bench;
mod bench_camera;
mod bench_register;
mod bench_segment;
mod bench_transport;
mod choice;
mod demo;
mod evaluate;
mod evaluate_chain;
mod evaluate_kitti;
mod evaluate_many;
mod evaluate_odometry;
mod evaluate_scans;
mod paper;
mod picture;
mod remaining;
mod show;
mod simulate;

use crate::CliResult;
use choice::{Choice, choice, processors};
use clap::Subcommand;
pub use picture::picture;
use show::show;

/// Commands of the laboratory.
#[derive(Subcommand)]
pub enum Lab {
    /// Simulate a loader at work, play its log through the nodes, show the maps of all lattices
    Demo(demo::Demo),
    /// Write the log, the points or the map of a simulated machine
    #[command(subcommand)]
    Simulate(simulate::Simulate),
    /// Measure calibration and registration
    #[command(subcommand)]
    Evaluate(evaluate::Evaluate),
    /// Compute every table and figure of a paper and set it beside what is printed
    #[command(subcommand)]
    Paper(paper::Paper),
    /// Measure quantizers and stores on a raw point file
    #[command(subcommand)]
    Bench(bench::Bench),
}

impl Lab {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        match self {
            Lab::Demo(command) => command.run(),
            Lab::Simulate(command) => command.run(),
            Lab::Evaluate(command) => command.run(),
            Lab::Paper(command) => command.run(),
            Lab::Bench(command) => command.run(),
        }
    }
}
