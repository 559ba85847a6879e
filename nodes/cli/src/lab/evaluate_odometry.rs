//! `lattice evaluate odometry`.

use super::{Choice, choice, processors};
use crate::CliResult;
use crate::progress::Progress;
use clap::Args;
use lattice_lab::evaluate::{odometry_report, run_odometry};
use lattice_lab::simulate::drive::DriveScene;
use lattice_lab::{markdown, write_report};
use std::path::PathBuf;

/// Options of `lattice evaluate odometry`.
#[derive(Args)]
pub struct OfDrives {
    /// Folder of the results and the report; a run that was ended is continued
    #[arg(long)]
    out: PathBuf,
    /// Drives of each scene
    #[arg(long, default_value_t = 5)]
    seeds: u64,
    /// Scenes
    #[arg(long, value_delimiter = ',', value_parser = choice(&SCENES),
        default_value = "town,indoor,corridor,tunnel,yard,blank,gap")]
    scenes: Vec<DriveScene>,
    /// Threads [default: as many as processors]
    #[arg(long)]
    threads: Option<usize>,
    /// Print the trials as JSON
    #[arg(long)]
    json: bool,
}

/// Values of `--scenes`.
const SCENES: [Choice<DriveScene>; 7] = [
    ("town", "A circuit of streets", DriveScene::Town),
    ("indoor", "A circuit in a hall", DriveScene::Indoor),
    ("corridor", "A corridor with doors", DriveScene::Corridor),
    ("tunnel", "A tunnel without features", DriveScene::Tunnel),
    ("yard", "A plane", DriveScene::Yard),
    (
        "blank",
        "A sensor that sees nothing for a while",
        DriveScene::Blank,
    ),
    ("gap", "Two seconds without scans", DriveScene::Gap),
];

impl OfDrives {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        let threads = self.threads.unwrap_or_else(processors);
        let bar = Progress::new("odometry");
        let trials = lattice_lab::pool(threads)?.install(|| {
            let told = &mut |done: usize, all: usize| bar.set(done as f64 / all.max(1) as f64);
            run_odometry(&self.out, &self.scenes, self.seeds, told)
        })?;
        bar.done();
        let report = odometry_report(&trials);
        write_report(&report, &self.out)?;
        match self.json {
            true => println!("{}", serde_json::to_string_pretty(&trials)?),
            false => print!("{}", markdown(&report)),
        }
        Ok(())
    }
}
