//! `lattice map export`.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use lattice_core::voxels::VoxelList;

use super::read;
use crate::cli::CliResult;
use crate::files::export::{RenderOptions, render_png, write_centers_ply, write_mesh_ply};

/// Options of `lattice map export`.
#[derive(Args)]
pub struct Export {
    /// Map file, as `--map-out` writes it
    map: PathBuf,
    /// File to write
    #[arg(long, short)]
    out: PathBuf,
    /// What to write; a `.png` file is always a picture
    #[arg(long = "as", value_enum, default_value = "centers")]
    form: Form,
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
    Png,
}

/// Draws a map file with the default view.
pub fn picture(map: &Path, out: &Path) -> CliResult {
    let (map, _) = read(map)?;
    let list = map.into_list(usize::MAX);
    let file = File::create(out).map_err(|e| format!("{}: {e}", out.display()))?;
    Ok(render_png(
        &list,
        &RenderOptions::default(),
        BufWriter::new(file),
    )?)
}

impl Export {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        let (map, _) = read(&self.map)?;
        let list = map.into_list(usize::MAX);
        let file = File::create(&self.out).map_err(|e| format!("{}: {e}", self.out.display()))?;
        let out = BufWriter::new(file);
        let picture = self.out.extension().is_some_and(|ending| ending == "png");
        match self.form {
            _ if picture => self.render(&list, out)?,
            Form::Png => self.render(&list, out)?,
            Form::Centers => write_centers_ply(&list, out)?,
            Form::Mesh => write_mesh_ply(&list, out)?,
        }
        Ok(())
    }

    fn render(&self, list: &VoxelList, out: BufWriter<File>) -> CliResult {
        let options = RenderOptions {
            width: self.width,
            height: self.height,
            azimuth_deg: self.azimuth,
            elevation_deg: self.elevation,
            ..RenderOptions::default()
        };
        Ok(render_png(list, &options, out)?)
    }
}
