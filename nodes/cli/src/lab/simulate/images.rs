//! `lattice simulate images`: images of rooms with depth, labels and poses.

use crate::CliResult;
use crate::lab::{Choice, choice, show};
use crate::progress::Progress;
use clap::Args;
use lattice_lab::datasets::{ImageCamera, ImageHouses, ImagesOptions, write_images};
use std::path::PathBuf;

/// Options of `lattice simulate images`.
#[derive(Args)]
pub struct Images {
    /// Folder for images.json, the list with cameras and poses, and for each image NUMBER_color.png,
    /// NUMBER_labels.png (8 bits, 255 is none) and NUMBER_depth.png (16 bits, mm)
    #[arg(long, default_value = "images")]
    out: PathBuf,
    /// Number of images
    #[arg(long, default_value_t = 64)]
    count: usize,
    /// Images of one house with one look: materials and lamps
    #[arg(long, default_value_t = 16)]
    per_house: usize,
    /// Houses that are seen
    #[arg(long, value_parser = choice(&ROOMS), default_value = "drawn", conflicts_with = "mesh")]
    rooms: Rooms,
    /// A mesh (PLY; faces with label and instance) instead
    #[arg(long, value_name = "PLY", requires = "classes")]
    mesh: Option<PathBuf>,
    /// Names of the classes of the mesh
    #[arg(long, value_name = "YAML", requires = "mesh")]
    classes: Option<PathBuf>,
    /// Camera that takes them
    #[arg(long, value_parser = choice(&CAMERAS), default_value = "robot")]
    camera: ImageCamera,
    /// Pixels in a row, and rows [default: those of the camera]
    #[arg(long, num_args = 2, value_names = ["WIDTH", "HEIGHT"])]
    size: Option<Vec<usize>>,
    /// Seed of the first house; the next has the next. The same seed gives the same bytes
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Replace files that are already there
    #[arg(long)]
    overwrite: bool,
    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, PartialEq, Debug)]
enum Rooms {
    Drawn,
    Generated,
}

/// Values of `--rooms`.
const ROOMS: [Choice<Rooms>; 2] = [
    ("drawn", "Other rooms in each house", Rooms::Drawn),
    (
        "generated",
        "The rooms of `lattice simulate house`",
        Rooms::Generated,
    ),
];

/// Values of `--camera`.
const CAMERAS: [Choice<ImageCamera>; 2] = [
    ("robot", "On the walk of a robot", ImageCamera::Robot),
    (
        "headset",
        "On the head of a person who looks at furniture",
        ImageCamera::Headset,
    ),
];

impl Images {
    pub(super) fn run(self) -> CliResult {
        let options = ImagesOptions {
            out: self.out,
            overwrite: self.overwrite,
            houses: match (self.mesh, self.classes, self.rooms) {
                (Some(mesh), Some(classes), _) => ImageHouses::Mesh(mesh, classes),
                (_, _, Rooms::Drawn) => ImageHouses::Drawn,
                (_, _, Rooms::Generated) => ImageHouses::Generated,
            },
            per_house: self.per_house,
            count: self.count,
            camera: self.camera,
            size: match self.size.as_deref() {
                Some(&[width, height]) => Some([width, height]),
                _ => None,
            },
            seed: self.seed,
        };
        let progress = Progress::new("simulate");
        let summary = write_images(&options, &mut |done| progress.set(done))?;
        progress.done();
        show(self.json, &summary)
    }
}
