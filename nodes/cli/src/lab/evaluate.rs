//! `lattice evaluate`: calibration and registration, measured.

use super::evaluate_chain::Chain;
use super::evaluate_kitti::Kitti;
use super::evaluate_many::{Many, Reliability, Rooms};
use super::evaluate_odometry::OfDrives;
use super::evaluate_scans::OfScans;
use super::remaining::with_remaining;
use super::{Choice, choice, processors};
use crate::{CliResult, init_logging};
use clap::{Args, Subcommand};
use lattice_lab::evaluate::{
    Pivot, Plan, Results, Settings, Start, Summary, TIMED, TRACKED, Testbed, competitors,
    read_house, report, run,
};
use lattice_lab::simulate::house::Scene;
use lattice_lab::{markdown, write_report};
use lattice_nodes::files::atomic_write::write_text;
use std::path::PathBuf;

/// Measure calibration and registration
#[derive(Subcommand)]
pub enum Evaluate {
    /// Calibrate a headset to a robot's map in a simulated house: four scenes, wrong labels, starts that
    /// are off or none at all, against ICP, GICP and Semantic-ICP
    Calibration(Calibration),
    /// Calibrate where no answer may be certain: rooms that look alike from several places, and clouds in wrong
    /// axes, of a wrong scale, leaning, or of another building
    Traps(Many),
    /// Calibrate a headset to a robot's map by rendered images and a network that labels them, beside the same without
    /// labels and with true ones; needs the feature `onnx`
    Chain(Chain),
    /// Find lidar scans of a simulated street in each other, 5 to 30 m apart, without a start
    Town(Many),
    /// Calibrate a headset in captured rooms to maps of robots whose sensors are below or above the tables
    Rooms(Rooms),
    /// Find parts of a given scan in another scan of the same place, without a start: reliability of the verdicts
    Scans(Box<OfScans>),
    /// Compare the error probabilities of verdicts of other evaluations with the observed errors
    Reliability(Reliability),
    /// Drive a lidar through simulated scenes, with motion during each scan, and register its scans: drift and verdicts
    Odometry(OfDrives),
    /// Register real labelled laser scans with each method, against the truth of an INS
    Kitti(Kitti),
}

/// Options of `lattice evaluate calibration`.
#[derive(Args)]
pub struct Calibration {
    /// Folder of the results and the report; an ended run is continued
    #[arg(long)]
    out: PathBuf,
    /// PLY of a house, metres, z up, with `label` and `instance` of each face [default: a house of our own]
    #[arg(long, value_name = "PLY", requires = "classes")]
    mesh: Option<PathBuf>,
    /// YAML with the names of its classes
    #[arg(long, value_name = "YAML", requires = "mesh")]
    classes: Option<PathBuf>,
    /// Trials of each cell
    #[arg(long, default_value_t = 30)]
    seeds: u64,
    /// First of their seeds, to measure with others than before
    #[arg(long, default_value_t = 0)]
    first_seed: u64,
    /// Shares of the view that are labelled wrongly, object by object
    #[arg(long, value_delimiter = ',', default_values_t = Plan::default().flips)]
    flips: Vec<f64>,
    /// Scenes that are looked at
    #[arg(long, value_delimiter = ',', value_parser = choice(&SCENES), default_value = "tv,desk,bookshelf,dining")]
    scenes: Vec<Scene>,
    /// Starts: metres/degrees off the truth, or none
    #[arg(long, value_delimiter = ',', default_values_t = Plan::default().starts)]
    starts: Vec<Start>,
    /// Point at which starts are moved and turned
    #[arg(long, value_parser = choice(&PIVOTS), default_value = "view")]
    pivot: Pivot,
    /// Only these methods, named as in trials.jsonl [default: all]
    #[arg(long, value_delimiter = ',', value_parser = method)]
    methods: Vec<String>,
    /// Trials at once [default: as many as processors]
    #[arg(long)]
    threads: Option<usize>,
    /// Pictures that the headset takes
    #[arg(long, default_value_t = 1)]
    headset_scans: usize,
    /// Share of each picture that is kept, from its left, as in 0.5 for half a view
    #[arg(long, default_value_t = Settings::default().view_part)]
    view_part: f64,
    /// Side of a cell of the robot's map, m
    #[arg(long, default_value_t = Settings::default().cell_side_m)]
    cell: f64,
    /// Surveys of the robot
    #[arg(long, default_value_t = Settings::default().map_seeds)]
    maps: u64,
    /// Also write the looks whose times are measured to the folder `looks` of the results, for other programs
    #[arg(long)]
    write_looks: bool,
    /// A few trials, in less than a minute
    #[arg(long)]
    quick: bool,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

fn method(name: &str) -> Result<String, String> {
    let known: Vec<&str> = competitors().chain([TIMED, TRACKED]).collect();
    match known.contains(&name) {
        true => Ok(name.to_owned()),
        false => Err(format!("one of {}", known.join(", "))),
    }
}

/// Values of `--scenes`.
const SCENES: [Choice<Scene>; 4] = [
    ("tv", "A television", Scene::Tv),
    ("desk", "A desk", Scene::Desk),
    ("bookshelf", "A bookshelf", Scene::Bookshelf),
    ("dining", "A dining table", Scene::Dining),
];

/// Values of `--pivot`.
const PIVOTS: [Choice<Pivot>; 2] = [
    ("view", "The centroid of the visible points", Pivot::View),
    ("headset", "The headset", Pivot::Headset),
];

impl Evaluate {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        init_logging();
        match self {
            Self::Calibration(command) => command.run(),
            Self::Traps(command) => command.traps(),
            Self::Chain(command) => command.run(),
            Self::Town(command) => command.town(),
            Self::Rooms(command) => command.run(),
            Self::Scans(command) => command.run(),
            Self::Reliability(command) => command.run(),
            Self::Odometry(command) => command.run(),
            Self::Kitti(command) => command.run(),
        }
    }
}

impl Calibration {
    fn run(self) -> CliResult {
        let mesh = self.mesh.clone().zip(self.classes.clone());
        let (house, mesh_crc32) = read_house(mesh.as_ref(), 1)?;
        let settings = Settings {
            mesh_crc32,
            cell_side_m: self.cell,
            map_seeds: if self.quick { 1 } else { self.maps },
            headset_scans: self.headset_scans,
            view_part: self.view_part,
            pivot: self.pivot,
            ..Settings::default()
        };
        let plan = self.plan();
        let threads = self.threads.unwrap_or_else(processors).clamp(1, 1024);
        let testbed = Testbed::new(house, &settings)?;
        let mut results = Results::open(&self.out, &settings)?;
        with_remaining(|told| run(&testbed, &plan, &mut results, threads, told))?;
        let trials = results.sorted();
        let summary = Summary::new(&settings, &trials, threads);
        let report = report(&summary, &trials)?;
        write_report(&report, &self.out)?;
        let json = serde_json::to_string_pretty(&summary)?;
        write_text(&self.out.join("summary.json"), &json)?;
        if self.json {
            println!("{json}");
        } else {
            print!("{}", markdown(&report));
            println!("\nwritten to {}", self.out.display());
        }
        Ok(())
    }

    fn plan(&self) -> Plan {
        let plan = Plan {
            scenes: self.scenes.clone(),
            first_seed: self.first_seed,
            seeds: self.seeds,
            flips: self.flips.clone(),
            starts: self.starts.clone(),
            methods: self.methods.clone(),
            looks: self.write_looks.then(|| self.out.join("looks")),
            ..Plan::default()
        };
        if !self.quick {
            return plan;
        }
        Plan {
            seeds: 1,
            flips: vec![0.0, 0.6],
            starts: vec![Start::Off { m: 0.3, deg: 10.0 }, Start::None],
            timed_seeds: 1,
            ..plan
        }
    }
}
