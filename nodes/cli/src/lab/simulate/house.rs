//! `lattice simulate house`: a robot's map and headset clouds with the truth.

use crate::CliResult;
use crate::lab::{Choice, choice, show};
use crate::progress::Progress;
use clap::Args;
use lattice_core::lattice::LatticeKind;
use lattice_lab::datasets::{HeadsetAxes, HouseOptions, write_house};
use lattice_lab::simulate::house::SurveyOptions;
use nalgebra::{Isometry3, Vector3};
use std::path::PathBuf;

/// Options of `lattice simulate house`.
#[derive(Args)]
pub struct House {
    /// Folder for map.lattice, classes.yaml, and for each of tv, desk, bookshelf and dining a cloud
    /// (.ply) with the truth beside it (.json)
    #[arg(long, default_value = "house")]
    out: PathBuf,
    /// A mesh (PLY with label and instance of each face, or glTF with them in extras) instead of our own house
    #[arg(long, value_name = "FILE", requires = "classes")]
    mesh: Option<PathBuf>,
    /// Names of the classes of the mesh
    #[arg(long, value_name = "YAML", requires = "mesh")]
    classes: Option<PathBuf>,
    /// The same seed gives the same bytes
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Place of the house in the map, m and degrees
    #[arg(long, num_args = 4, value_names = ["X", "Y", "Z", "YAW"], allow_negative_numbers = true)]
    place: Option<Vec<f64>>,
    /// Share of the headset's view whose regions are labelled wrongly, 0 to 1
    #[arg(long, value_name = "Q", default_value_t = 0.0)]
    flips: f64,
    /// Pictures of each scene; the further ones look to the sides
    #[arg(long, default_value_t = 1)]
    headset_scans: usize,
    /// Depth views of the robot
    #[arg(long, default_value_t = SurveyOptions::default().views)]
    views: usize,
    /// Lattice of the map
    #[arg(long, default_value = "cubic")]
    lattice: LatticeKind,
    /// Edge of the cube with the volume of one cell, m
    #[arg(long, alias = "cell-side", default_value_t = 0.05, value_name = "M")]
    cell_size: f64,
    /// Axes of the headset's clouds
    #[arg(long, value_parser = choice(&AXES), default_value = "ros")]
    axes: HeadsetAxes,
    /// Replace files that are already there
    #[arg(long)]
    overwrite: bool,
    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
}

/// Values of `--axes`.
const AXES: [Choice<HeadsetAxes>; 2] = [
    ("ros", "x forward, y left, z up", HeadsetAxes::Ros),
    ("unity", LEFT_HANDED, HeadsetAxes::Unity),
];
const LEFT_HANDED: &str = "x right, y up, z forward: left-handed";

impl House {
    pub(super) fn run(self) -> CliResult {
        let place = match self.place.as_deref() {
            Some(&[x, y, z, yaw_deg]) => {
                let turn = Vector3::z() * yaw_deg.to_radians();
                Isometry3::new(Vector3::new(x, y, z), turn)
            }
            _ => Isometry3::identity(),
        };
        let options = HouseOptions {
            out: self.out,
            overwrite: self.overwrite,
            mesh: self.mesh.zip(self.classes),
            map_from_house: place,
            seed: self.seed,
            survey: SurveyOptions {
                views: self.views,
                ..SurveyOptions::default()
            },
            headset_scans: self.headset_scans,
            flips: self.flips,
            lattice: self.lattice,
            cell_side_m: self.cell_size,
            axes: self.axes,
        };
        let progress = Progress::new("simulate");
        let summary = write_house(&options, &mut |done| progress.set(done))?;
        progress.done();
        show(self.json, &summary)
    }
}
