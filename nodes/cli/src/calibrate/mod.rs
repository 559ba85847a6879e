//! `lattice calibrate`: pose of one cloud in another, and mounts of sensors.

mod answer;
pub mod input;
mod methods;
#[cfg(feature = "bags")]
mod mounts;
pub mod options;
mod progress;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

use clap::{ArgMatches, Args, Command, FromArgMatches};
use lattice_core::pose::Axes;
use lattice_core::registration::{
    CalibrationMap, CalibrationOptions, CalibrationRequest, SemanticCloud, SourceCloud, Verdict,
    register_global,
};
use nalgebra::Isometry3;

use super::points::Columns;
use super::progress::Progress;
use super::{CliResult, init_logging};
use answer::{Answer, Times};
use input::{Guess, Place};
use lattice_nodes::files::classes::read_classes;
use methods::{MethodName, register_once};
use options::SearchOptions;
use progress::{Shown, milliseconds};

/// Command `lattice calibrate`: pose of a cloud, or a subcommand.
pub enum CalibrateCommand {
    /// Pose of a cloud in a map.
    Cloud(Box<Calibrate>),
    /// Mount of a sensor.
    #[cfg(feature = "bags")]
    Mounts(Box<mounts::Mounts>),
}

/// Name of the subcommand.
#[cfg(feature = "bags")]
const MOUNTS: &str = "mounts";

impl CalibrateCommand {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        match self {
            Self::Cloud(command) => command.run(),
            #[cfg(feature = "bags")]
            Self::Mounts(command) => command.run(),
        }
    }
}

#[cfg(feature = "bags")]
fn with_subcommands(command: Command) -> Command {
    command
        .args_conflicts_with_subcommands(true)
        .subcommand_negates_reqs(true)
        .subcommand(mounts::Mounts::augment_args(Command::new(MOUNTS)))
}

#[cfg(not(feature = "bags"))]
fn with_subcommands(command: Command) -> Command {
    command
}

// By hand: the derived form has no required options beside a subcommand.
impl FromArgMatches for CalibrateCommand {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        #[cfg(feature = "bags")]
        if let Some((MOUNTS, matches)) = matches.subcommand() {
            let mounts = mounts::Mounts::from_arg_matches(matches)?;
            return Ok(Self::Mounts(Box::new(mounts)));
        }
        Calibrate::from_arg_matches(matches).map(|cloud| Self::Cloud(Box::new(cloud)))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl Args for CalibrateCommand {
    fn augment_args(command: Command) -> Command {
        with_subcommands(Calibrate::augment_args(command))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

/// Options of `lattice calibrate`.
///
/// Finds the pose of a cloud's frame in a map, without a guess if none is given, and judges whether
/// the result is reliable. The exit status is 0 only with the verdict OK, or with a method other
/// than `auto` if it converged; the result is printed in any case.
#[derive(Args)]
pub struct Calibrate {
    /// Map file, or ply, pcd, xyz (also .bz2) with or without a number `label` of each point, las, laz, e57, bt
    /// or ot (octomap), or KITTI bin with a .label file of SemanticKITTI beside it or in ../labels; metres, z up
    #[arg(long, value_name = "FILE")]
    map: PathBuf,
    /// Cloud to find in it, of the same formats; gravity along -z once the axes are those of ROS. Several clouds
    /// of one frame are used together
    #[arg(long, value_name = "FILE", required = true)]
    cloud: Vec<PathBuf>,
    /// YAML with the names of the classes, `classes:` followed by lines `number: name`
    #[arg(long, value_name = "FILE")]
    labels: Option<PathBuf>,
    /// Approximate pose of the cloud's frame in the map: "x y z yaw_deg" or "x y z qx qy qz qw"
    #[arg(long, allow_hyphen_values = true)]
    guess: Option<Guess>,
    /// Position of the cloud's sensor, in its axes: "x y z" (m)
    #[arg(long, allow_hyphen_values = true)]
    sensor: Option<Place>,
    /// Axes of the cloud: ros_flu, unity_ruf (left-handed), winrt_rub or optical
    #[arg(long, default_value = "ros_flu")]
    axes: Axes,
    /// auto searches and gives a verdict; the others are single registrations from the guess
    #[arg(long, value_parser = MethodName::parser(), default_value = "auto")]
    method: MethodName,
    /// Correspondence distance limit of single registrations, m [default: as published]
    #[arg(long)]
    gate: Option<f64>,
    /// Label confusion learned by earlier calibrations: read if the file exists, written
    /// after a calibration that is OK
    #[arg(long, value_name = "FILE")]
    confusion: Option<PathBuf>,
    /// Cell size for thinning points, m [default: that of the map file or octree; of a
    /// point file 1/400 of the diagonal, at least 0.05]
    #[arg(long)]
    cell: Option<f64>,
    /// Limit of points per file
    #[arg(long, default_value_t = 20_000_000)]
    max_points: usize,
    #[command(flatten)]
    columns: Columns,
    /// Print as JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    search: SearchOptions,
}

impl Calibrate {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        init_logging();
        self.check()?;
        let most = self.max_points.saturating_mul(self.cloud.len());
        // Options are checked before anything is read.
        self.search.options(self.axes, most, &[])?;
        let names = match &self.labels {
            Some(path) => read_classes(path).map_err(|e| format!("{}: {e}", path.display()))?,
            None => BTreeMap::new(),
        };
        let started = Instant::now();
        let files = self.cloud.iter().chain([&self.map]).map(PathBuf::as_path);
        let reading = self
            .columns
            .options(self.max_points, &files.collect::<Vec<_>>())?;
        let (map, cell_side_m) = input::map(&self.map, self.cell, &reading)?;
        let sensor_m = self.sensor.as_ref().map(|p| self.axes.point_to_ros(&p.0));
        let clouds = input::headset_scans(&self.cloud, self.axes, sensor_m, &reading)?;
        let headset_scans = &clouds.scans;
        let start = self
            .guess
            .as_ref()
            .map(|guess| clouds.pose_of_middle(&guess.0));
        let mut times = Times {
            read_ms: milliseconds(started),
            ..Times::default()
        };
        let options = self.search.options(self.axes, most, headset_scans)?;
        let points = headset_scans.iter().map(|scan| scan.cloud.len()).sum();
        let map_points = map.len();
        let mut answer = match self.method.single(self.gate) {
            Some(method) => {
                let start = start.unwrap_or(clouds.pose_of_middle(&Isometry3::identity()));
                let map = (map, cell_side_m);
                let registration = register_once(&method, map, headset_scans, &start, &mut times)?;
                Answer::of_registration(self.method.name(), &registration)
            }
            None => {
                let map = (map, cell_side_m);
                let scans = (headset_scans.as_slice(), start);
                self.find(map, scans, &options, &names, &mut times)?
            }
        };
        answer.place_origin(&clouds.middle_m, self.search.scales());
        (answer.points, answer.map_points, answer.times) = (points, map_points, times);
        if self.json {
            println!("{}", serde_json::to_string_pretty(&answer)?);
        } else {
            print!("{answer}");
        }
        match answer.refusal() {
            None => Ok(()),
            Some(reason) => Err(reason.into()),
        }
    }

    fn check(&self) -> Result<(), String> {
        let positive = |name: &str, value: Option<f64>| match value {
            Some(v) if !(v.is_finite() && v > 0.0) => Err(format!("--{name} {v} is not above 0")),
            _ => Ok(()),
        };
        positive("gate", self.gate)?;
        positive("cell", self.cell)
    }

    /// Searches, judges and stores the learned confusion.
    fn find(
        &self,
        (map, cell_side_m): (SemanticCloud, f64),
        (headset_scans, start): (&[SourceCloud], Option<Isometry3<f64>>),
        options: &CalibrationOptions,
        names: &BTreeMap<u16, String>,
        times: &mut Times,
    ) -> CliResult<Answer> {
        let known = match &self.confusion {
            Some(path) => input::confusion(path)?,
            None => None,
        };
        let bar = Progress::new("calibrate");
        bar.say("map");
        let started = Instant::now();
        let map = CalibrationMap::new(map, cell_side_m)
            .map_err(|e| format!("{}: {e}", self.map.display()))?;
        times.map_ms = milliseconds(started);
        let request = CalibrationRequest {
            source_clouds: headset_scans,
            start,
            confusion: known.as_ref(),
        };
        let started = Instant::now();
        let calibration = register_global(&map, &request, options, &Shown(&bar));
        times.calibrate_ms = milliseconds(started);
        bar.done();
        if let (Some(path), Verdict::Ok) = (&self.confusion, calibration.verdict) {
            input::keep_confusion(path, &calibration.confusion)?;
        }
        Ok(Answer::of_calibration(&calibration, options.profile, names))
    }
}
