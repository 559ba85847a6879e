//! `lattice evaluate odometry`.

use super::{Choice, choice, processors};
use crate::CliResult;
use crate::progress::Progress;
use clap::Args;
use lattice_lab::evaluate::{OdometryLog, measure_log, odometry_report, run_odometry};
use lattice_lab::simulate::drive::DriveScene;
use lattice_lab::{markdown, write_report};
use std::path::PathBuf;

/// Options of `lattice evaluate odometry`.
#[derive(Args)]
pub struct OfDrives {
    /// Folder of the results and the report; a run that was ended is continued
    #[arg(long, required_unless_present = "log", conflicts_with = "log")]
    out: Option<PathBuf>,
    /// Drives of each scene
    #[arg(long, default_value_t = 5, conflicts_with = "log")]
    seeds: u64,
    /// Scenes
    #[arg(long, value_delimiter = ',', value_parser = choice(&SCENES), conflicts_with = "log",
        default_value = "town,indoor,corridor,tunnel,yard,blank,gap")]
    scenes: Vec<DriveScene>,
    /// Log (rosbag2) to measure instead; its scans are registered as by `lattice replay`, whichever poses it has
    #[arg(long, value_name = "LOG", requires = "truth")]
    log: Option<PathBuf>,
    /// True poses, `stamp x y z qx qy qz qw` in each line, of `base_link` where transforms connect it with the clouds,
    /// else of their frame; gaps above 0.25 s are not interpolated
    #[arg(long, value_name = "TUM", requires = "log")]
    truth: Option<PathBuf>,
    /// Topic of the clouds; by default that with the most clouds
    #[arg(long, value_name = "TOPIC", requires = "log")]
    points: Option<String>,
    /// Threads [default: as many as processors]
    #[arg(long)]
    threads: Option<usize>,
    /// Print the trials as JSON
    #[arg(long)]
    json: bool,
}

/// Scenes of drives.
pub const SCENES: [Choice<DriveScene>; 9] = [
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
    (
        "town_again",
        "The streets, and half of them again",
        DriveScene::TownAgain,
    ),
    (
        "indoor_again",
        "The hall, and half of it again",
        DriveScene::IndoorAgain,
    ),
];

impl OfDrives {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        let pool = lattice_lab::pool(self.threads.unwrap_or_else(processors))?;
        let bar = Progress::new("odometry");
        let (trials, report) = match (self.log, self.truth, self.out) {
            (Some(log), Some(truth), _) => {
                let points = self.points;
                let of = OdometryLog { log, truth, points };
                let (trial, report) =
                    pool.install(|| measure_log(&of, &mut |done| bar.set(done)))?;
                (vec![trial], report)
            }
            (_, _, Some(out)) => {
                let trials = pool.install(|| {
                    let told =
                        &mut |done: usize, all: usize| bar.set(done as f64 / all.max(1) as f64);
                    run_odometry(&out, &self.scenes, self.seeds, told)
                })?;
                let report = odometry_report(&trials);
                write_report(&report, &out)?;
                (trials, report)
            }
            _ => return Err("--out FOLDER, or --log LOG with --truth TUM, is missing".into()),
        };
        bar.done();
        match self.json {
            true => println!("{}", serde_json::to_string_pretty(&trials)?),
            false => print!("{}", markdown(&report)),
        }
        Ok(())
    }
}
