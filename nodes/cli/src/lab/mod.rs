//! The commands of the laboratory: simulation, papers, evaluations, benchmarks.

mod bench;
mod bench_camera;
mod bench_register;
mod bench_segment;
mod bench_transport;
mod demo;
mod evaluate;
mod evaluate_chain;
mod evaluate_kitti;
mod evaluate_many;
mod evaluate_odometry;
mod evaluate_scans;
mod paper;
mod simulate;

use crate::CliResult;
use clap::Subcommand;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use lattice_core::voxels::VoxelList;
use lattice_lab::render::{RenderOptions, render_png};
use lattice_nodes::files::atomic_write;
use serde::Serialize;
use std::fmt::Display;
use std::path::Path;

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

/// Draws a map as a PNG file.
pub fn picture(list: &VoxelList, options: &RenderOptions, out: &Path) -> CliResult {
    atomic_write::write(out, |file| render_png(list, options, file))
}

/// A value of an option with its name and help.
type Choice<T> = (&'static str, &'static str, T);

/// Parser of an option that takes one of some names, each with its help and its value.
fn choice<T: Clone + Send + Sync + 'static>(
    choices: &'static [Choice<T>],
) -> impl TypedValueParser<Value = T> {
    let names = choices.iter();
    let names = names.map(|(name, help, _)| PossibleValue::new(*name).help(*help));
    PossibleValuesParser::new(names).try_map(|chosen: String| {
        let found = choices.iter().find(|(name, ..)| *name == chosen);
        found.map(|choice| choice.2.clone()).ok_or("no such choice")
    })
}

/// Prints a summary, as JSON if that is asked for.
fn show(json: bool, summary: &(impl Serialize + Display)) -> CliResult {
    match json {
        true => println!("{}", serde_json::to_string_pretty(summary)?),
        false => println!("{summary}"),
    }
    Ok(())
}

/// Number of processors.
fn processors() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}
