//! `lattice map export`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::read;
use crate::CliResult;
#[cfg(feature = "lab")]
use lattice_lab::render::RenderOptions;
use lattice_nodes::files::export::{write_centers_ply, write_mesh_ply};
use lattice_nodes::files::whole;

/// Options of `lattice map export`.
#[derive(Args)]
pub struct Export {
    /// Map file, as `--map-out` writes it
    map: PathBuf,
    /// File to write
    #[arg(long, short)]
    out: PathBuf,
    /// Form to write; a `.png` file is always a picture
    #[arg(long = "as", value_enum, default_value = "centers")]
    form: Form,
    #[cfg(feature = "lab")]
    #[command(flatten)]
    picture: Picture,
}

/// Camera of the picture.
#[cfg(feature = "lab")]
#[derive(Args)]
struct Picture {
    /// Size of the picture
    #[arg(long, default_value_t = 1200)]
    width: u32,
    /// Size of the picture
    #[arg(long, default_value_t = 800)]
    height: u32,
    /// Direction from which the picture is taken, clockwise from north
    #[arg(long, default_value_t = 215.0)]
    azimuth: f64,
    /// Height of the camera over the horizon, in degrees
    #[arg(long, default_value_t = 35.0)]
    elevation: f64,
}

#[derive(Clone, Copy, ValueEnum, PartialEq, Eq)]
enum Form {
    /// PLY points: centre, count and mean offset of every voxel
    Centers,
    /// PLY mesh: exposed faces of the cells
    Mesh,
    /// PNG picture
    #[cfg(feature = "lab")]
    Png,
}

impl Export {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        let (map, _) = read(&self.map)?;
        let list = map.into_list(usize::MAX);
        #[cfg(feature = "lab")]
        if self.form == Form::Png || self.out.extension().is_some_and(|ending| ending == "png") {
            return crate::lab::picture(&list, &self.picture.options(), &self.out);
        }
        whole::write(&self.out, |out| match self.form {
            Form::Centers => write_centers_ply(&list, out),
            Form::Mesh => write_mesh_ply(&list, out),
            #[cfg(feature = "lab")]
            Form::Png => Ok(()),
        })
    }
}

#[cfg(feature = "lab")]
impl Picture {
    fn options(&self) -> RenderOptions {
        RenderOptions {
            width: self.width,
            height: self.height,
            azimuth_deg: self.azimuth,
            elevation_deg: self.elevation,
            ..RenderOptions::default()
        }
    }
}
