//! The `lattice` command, and every node by its name.

// First, for its macros.
#[macro_use]
mod streams;

mod about;
#[cfg(feature = "bags")]
mod bag;
#[cfg(feature = "bags")]
mod calendar;
mod calibrate;
mod cell_size;
mod cli_result;
mod doctor;
mod fleet;
mod health;
#[cfg(feature = "lab")]
mod lab;
mod lattices;
mod link;
mod map;
mod node;
#[cfg(feature = "pages")]
mod pages;
mod points;
mod progress;
mod quantize;
#[cfg(feature = "bags")]
mod record;
#[cfg(feature = "bags")]
mod replay;
mod run;
mod tool_log;
#[cfg(feature = "viewer")]
mod view;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use cli_result::CliResult;
use lattices::Lattices;
use tool_log::init_logging;

/// Lattice voxel maps from logs and live robots.
#[derive(Parser)]
#[command(name = "lattice", version, about, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Run several nodes in one process, as given by parameter files
    Run(run::Run),
    /// Show a map in the browser: a map file, a point file, a log, or a live map
    #[cfg(feature = "viewer")]
    View(view::View),
    /// Run one node
    Node(node::NodeCommand),
    /// Fail unless nodes are running and healthy, by their diagnostics; for health checks of containers
    Health(health::Health),
    /// Find out why nodes do not discover each other or receive no messages
    Doctor(doctor::Doctor),
    /// Create a link to this program for every node; called by that name, it runs the node
    Link(link::Link),
    /// Map a rosbag2 log: in this process, or played to separate node processes
    #[cfg(feature = "bags")]
    Replay(replay::Replay),
    /// Record topics of any type as a rosbag2 log
    #[cfg(feature = "bags")]
    Record(Box<record::Record>),
    /// Inspect and recover rosbag2 logs
    #[cfg(feature = "bags")]
    #[command(subcommand)]
    Bag(bag::Bag),
    /// Quantize a point file (ply, pcd, las, laz, e57, bt, xyz, KITTI bin) and compare lattices
    Quantize(quantize::Quantize),
    /// Find the pose of a cloud in a map, without a guess, with a verdict; or the mount of a sensor from a log
    Calibrate(calibrate::CalibrateCommand),
    /// Inspect and export map files
    #[command(subcommand)]
    Map(map::Map),
    /// Merge logs and robots into one map as tables on a data engine; needs the program lattice-fleet
    Fleet(fleet::Fleet),
    /// Print version, licences and features of this program
    About(about::About),
    /// Write man pages and shell completions
    #[cfg(feature = "pages")]
    #[command(hide = true)]
    Pages(pages::Pages),
    #[cfg(feature = "lab")]
    #[command(flatten)]
    Lab(lab::Lab),
}

/// Runs a node if the program was called by its name, the command line otherwise. An error is one line
/// on standard error and a non-zero exit status.
fn main() -> ExitCode {
    // A file size limit (`ulimit -f`) becomes a write error, like a full disk.
    if let Err(error) = lattice_runtime::catch_file_size_signal() {
        eprintln!("lattice: SIGXFSZ cannot be caught: {error}");
    }
    let node = node::called_as(std::env::args_os().next());
    let result = match &node {
        Some(name) => node::run(name, std::env::args().skip(1)),
        None => Cli::parse().command.run(),
    };
    let result = result.and_then(|()| Ok(streams::finish()?));
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{}: {error}", node.as_deref().unwrap_or("lattice"));
            ExitCode::FAILURE
        }
    }
}

impl Command {
    fn run(self) -> CliResult {
        match self {
            Command::Run(command) => command.run(),
            #[cfg(feature = "viewer")]
            Command::View(command) => command.run(),
            Command::Node(command) => command.run(),
            Command::Health(command) => command.run(),
            Command::Doctor(command) => command.run(),
            Command::Link(command) => command.run(),
            #[cfg(feature = "bags")]
            Command::Replay(command) => command.run(),
            #[cfg(feature = "bags")]
            Command::Record(command) => command.run(),
            #[cfg(feature = "bags")]
            Command::Bag(command) => command.run(),
            Command::Quantize(command) => command.run(),
            Command::Calibrate(command) => command.run(),
            Command::Map(command) => command.run(),
            Command::Fleet(command) => command.run(),
            Command::About(command) => command.run(),
            #[cfg(feature = "pages")]
            Command::Pages(command) => command.run(<Cli as clap::CommandFactory>::command()),
            #[cfg(feature = "lab")]
            Command::Lab(command) => command.run(),
        }
    }
}
