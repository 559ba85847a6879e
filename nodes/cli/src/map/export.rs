//! `lattice map export`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::read;
use crate::CliResult;
#[cfg(feature = "lab")]
use lattice_lab::render::RenderOptions;
use lattice_nodes::files::export::{write_centers_ply, write_centers_xyz, write_mesh_ply};
use lattice_nodes::files::whole;

/// Options of `lattice map export`.
#[derive(Args)]
pub struct Export {
    /// Map file, as `--map-out` writes it
    map: PathBuf,
    /// File to write: .ply, .xyz (centres as text) or .png (a picture); without extension PLY
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
        let text = self.check()?;
        let (map, _) = read(&self.map)?;
        let list = map.into_list(usize::MAX);
        #[cfg(feature = "lab")]
        if self.form == Form::Png || self.out.extension().is_some_and(|ending| ending == "png") {
            return crate::lab::picture(&list, &self.picture.options(), &self.out);
        }
        whole::write(&self.out, |out| match self.form {
            Form::Centers if text => write_centers_xyz(&list, out),
            Form::Centers => write_centers_ply(&list, out),
            Form::Mesh => write_mesh_ply(&list, out),
            #[cfg(feature = "lab")]
            Form::Png => Ok(()),
        })
    }

    /// True for text; refuses what the extension promises and the form is not.
    fn check(&self) -> Result<bool, String> {
        let extension = self.out.extension().unwrap_or_default().to_string_lossy();
        let form = self.form;
        match (extension.to_ascii_lowercase().as_str(), form) {
            ("xyz", Form::Centers) => Ok(true),
            ("ply", Form::Centers | Form::Mesh) | ("", _) => Ok(false),
            #[cfg(feature = "lab")]
            ("png", _) => Ok(false),
            _ => {
                let name = form.to_possible_value();
                let name = name.as_ref().map_or("this", |value| value.get_name());
                let out = self.out.display();
                let known = match form {
                    Form::Centers => ".ply or .xyz",
                    Form::Mesh => ".ply",
                    #[cfg(feature = "lab")]
                    Form::Png => ".png",
                };
                Err(format!(
                    "{out}: --as {name} writes {known}, no .{extension}"
                ))
            }
        }
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
