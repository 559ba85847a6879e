//! `lattice simulate`: logs and point files of simulated machines.

mod drive;
mod house;
mod images;
mod town;

use super::{Choice, choice, show};
use crate::progress::Progress;
use crate::{CliResult, init_logging};
use clap::{Args, Subcommand};
use lattice_bag::Storage;
use lattice_lab::bench::{SiteOptions, write_site};
use lattice_lab::datasets::{BobcatOptions, BobcatSummary, write_bobcat};
use lattice_lab::simulate::SurveyPattern;
use std::path::PathBuf;

/// Write the log, the points or the map of a simulated machine
#[derive(Subcommand)]
pub enum Simulate {
    /// A skid-steer loader on an earth-moving site: three laser scanners, one on a turntable, and
    /// an INS at 100 Hz
    Bobcat(Bobcat),
    /// A survey of the same site as raw little-endian f32 `x y z i` points, for benchmarks
    Site(Site),
    /// A furnished house: a robot's labelled map, what a headset sees of four scenes, and the truth
    House(house::House),
    /// Images of rooms as the camera of a robot or a headset sees them, with depth, true labels and poses, for
    /// training networks
    Images(images::Images),
    /// A street of a town as two lidar scans see it at different times, and the truth
    Town(town::Town),
    /// The log of a lidar that moves through a scene, without poses, and the truth: to try odometry
    Drive(drive::Drive),
}

/// Values of `--storage`.
const STORAGES: [Choice<Storage>; 2] = [
    ("mcap", "MCAP", Storage::Mcap),
    ("sqlite3", "SQLite", Storage::Sqlite3),
];

/// Values of `--pattern`.
const PATTERNS: [Choice<SurveyPattern>; 2] = [
    ("lms200", LMS200, SurveyPattern::Lms200),
    (
        "os64",
        "One spinning scanner of 64 beams",
        SurveyPattern::Os64,
    ),
];
const LMS200: &str = "Three SICK LMS200, one of them on a turntable";

/// Options of `lattice simulate bobcat`.
#[derive(Args)]
pub struct Bobcat {
    /// Directory of the log; it gets the rosbag2 files, and `truth/` with the ground truth
    #[arg(long, default_value = "bobcat")]
    out: PathBuf,
    /// The same seed gives the same bytes
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Length of the log in s
    #[arg(long, default_value_t = 30.0)]
    duration: f64,
    /// Time of the tour at which the log begins, s; its stamps are as much later
    #[arg(long, default_value_t = 0.0, value_name = "SECONDS")]
    begin: f64,
    /// Let a person walk through the yard in the first 15 s
    #[arg(long)]
    person: bool,
    /// Write the lasers as their drivers do: LaserScan on /left/scan, /right/scan and /top/scan in place of
    /// PointCloud2
    #[arg(long)]
    scans: bool,
    /// Constant error of the INS, as by a base station at wrong coordinates: m to the east, north and up,
    /// degrees about up
    #[arg(long, num_args = 4, allow_negative_numbers = true, value_names = ["EAST", "NORTH", "UP", "TURN"])]
    ins_offset: Option<Vec<f64>>,
    /// Container of the messages
    #[arg(long, value_parser = choice(&STORAGES), default_value = "mcap")]
    storage: Storage,
    /// Replace a log that is already there
    #[arg(long)]
    overwrite: bool,
    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
}

/// Options of `lattice simulate site`.
#[derive(Args)]
pub struct Site {
    /// Number of points
    #[arg(long, default_value_t = 10_000_000)]
    points: u64,
    /// The scanners
    #[arg(long, value_parser = choice(&PATTERNS), default_value = "lms200")]
    pattern: SurveyPattern,
    /// The same seed gives the same bytes
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Point file; FILE.scans gets the scanner's position (three f64) and the points (u64) of each scan
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
}

impl Simulate {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        init_logging();
        match self {
            Self::Bobcat(command) => command.run(),
            Self::Site(command) => command.run(),
            Self::House(command) => command.run(),
            Self::Images(command) => command.run(),
            Self::Town(command) => command.run(),
            Self::Drive(command) => command.run(),
        }
    }
}

impl Site {
    fn run(self) -> CliResult {
        let progress = Progress::new("simulate");
        let options = SiteOptions {
            seed: self.seed,
            pattern: self.pattern,
            points: self.points,
            out: self.out,
        };
        let summary = write_site(&options, &mut |done| progress.set(done))?;
        progress.done();
        show(self.json, &summary)
    }
}

impl Bobcat {
    fn run(self) -> CliResult {
        let summary = bobcat(&BobcatOptions {
            seed: self.seed,
            duration_s: self.duration,
            begin_s: self.begin,
            person: self.person,
            scans: self.scans,
            ins_offset: match self.ins_offset.as_deref() {
                Some(&[east_m, north_m, up_m, turn_deg]) => [east_m, north_m, up_m, turn_deg],
                _ => [0.0; 4],
            },
            storage: self.storage,
            out: self.out,
            overwrite: self.overwrite,
        })?;
        show(self.json, &summary)
    }
}

/// Writes a log behind a progress bar.
pub fn bobcat(
    options: &BobcatOptions,
) -> Result<BobcatSummary, Box<dyn std::error::Error + Send + Sync>> {
    let progress = Progress::new("simulate");
    let summary = write_bobcat(options, &mut |done| progress.set(done))?;
    progress.done();
    Ok(summary)
}
