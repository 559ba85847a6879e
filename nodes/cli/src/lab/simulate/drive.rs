//! `lattice simulate drive`: the log of a lidar that moves through a scene.

use crate::CliResult;
use crate::lab::evaluate_odometry::SCENES;
use crate::lab::{choice, show};
use crate::progress::Progress;
use clap::Args;
use lattice_lab::datasets::{DriveLogOptions, write_drive};
use lattice_lab::simulate::drive::DriveScene;
use std::path::PathBuf;

/// Options of `lattice simulate drive`.
#[derive(Args)]
pub struct Drive {
    /// Directory of the log: clouds on `/points`, and no poses, so that `lattice replay` takes lidar odometry. The true
    /// poses are in DIR/truth.tum, of `lidar` every 10 ms, for `lattice evaluate odometry` and evo
    #[arg(long, default_value = "drive", value_name = "DIR")]
    out: PathBuf,
    /// Scene
    #[arg(long, value_parser = choice(&SCENES), default_value = "town")]
    scene: DriveScene,
    /// The same seed gives the same bytes
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Length of the log in s [default: the whole drive]
    #[arg(long)]
    duration: Option<f64>,
    /// Replace a log that is already there
    #[arg(long)]
    overwrite: bool,
    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
}

impl Drive {
    pub(super) fn run(self) -> CliResult {
        let options = DriveLogOptions {
            out: self.out,
            overwrite: self.overwrite,
            scene: self.scene,
            seed: self.seed,
            duration_s: self.duration,
        };
        let progress = Progress::new("simulate");
        let summary = write_drive(&options, &mut |done| progress.set(done))?;
        progress.done();
        show(self.json, &summary)
    }
}
