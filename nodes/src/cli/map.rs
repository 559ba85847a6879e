//! `lattice map`: map files.

use std::fs::File;
use std::io::{BufReader, BufWriter};
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand, ValueEnum};
use lattice_core::voxels::VoxelList;
use lattice_core::voxels::file::read_map;
use serde::Serialize;

use super::{CliResult, init_logging};
use crate::files::export::{RenderOptions, render_png, write_centers_ply, write_mesh_ply};

/// Look into map files and export them
#[derive(Subcommand)]
pub enum Map {
    /// Lattice, size, extent and statistics
    Info(Info),
    /// As PLY (cell centres, or a mesh of exposed cell faces) or as a picture
    Export(Export),
}

/// Options of `lattice map info`.
#[derive(Args)]
pub struct Info {
    /// Map file, as `--map-out` writes it
    map: PathBuf,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

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

#[derive(Serialize)]
struct Summary {
    lattice: &'static str,
    cell_volume_m3: f64,
    datum_m: [f64; 3],
    voxels: usize,
    points: u64,
    min_m: Option<[f64; 3]>,
    max_m: Option<[f64; 3]>,
    mse_per_dimension_m2: f64,
    mean_distance_m: f64,
    rms_m: f64,
    max_distance_m: f64,
    file_bytes: u64,
    bytes_per_voxel: f64,
}

impl Map {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        init_logging();
        match self {
            Self::Info(command) => command.run(),
            Self::Export(command) => command.run(),
        }
    }
}

/// Reads a map; the file itself bounds its voxels, for each takes at least a byte.
fn read(path: &Path) -> Result<(VoxelList, u64), Box<dyn std::error::Error + Send + Sync>> {
    let here = |e: &dyn std::fmt::Display| format!("{}: {e}", path.display());
    let file = File::open(path).map_err(|e| here(&e))?;
    let bytes = file.metadata().map_err(|e| here(&e))?.len();
    let max_voxels = usize::try_from(bytes)?;
    let list = read_map(BufReader::new(file), max_voxels).map_err(|e| here(&e))?;
    Ok((list, bytes))
}

/// Draws a map file with the default view.
pub fn picture(map: &Path, out: &Path) -> CliResult {
    let (list, _) = read(map)?;
    let file = File::create(out).map_err(|e| format!("{}: {e}", out.display()))?;
    Ok(render_png(
        &list,
        &RenderOptions::default(),
        BufWriter::new(file),
    )?)
}

impl Info {
    fn run(self) -> CliResult {
        let (list, file_bytes) = read(&self.map)?;
        let mut bounds: Option<([f64; 3], [f64; 3])> = None;
        for (key, _) in list.sorted() {
            let center: [f64; 3] = list.center_m(key).into();
            let (min, max) = bounds.get_or_insert((center, center));
            for axis in 0..3 {
                min[axis] = min[axis].min(center[axis]);
                max[axis] = max[axis].max(center[axis]);
            }
        }
        let distortion = list.distortion();
        let summary = Summary {
            lattice: list.lattice().kind().name(),
            cell_volume_m3: list.lattice().cell_volume_m3(),
            datum_m: list.datum_m().into(),
            voxels: list.len(),
            points: distortion.points,
            min_m: bounds.map(|(min, _)| min),
            max_m: bounds.map(|(_, max)| max),
            mse_per_dimension_m2: distortion.mse_per_dimension_m2,
            mean_distance_m: distortion.mean_distance_m,
            rms_m: distortion.rms_m,
            max_distance_m: distortion.max_distance_m,
            file_bytes,
            bytes_per_voxel: file_bytes as f64 / (list.len().max(1)) as f64,
        };
        if self.json {
            println!("{}", serde_json::to_string_pretty(&summary)?);
            return Ok(());
        }
        println!(
            "lattice        {}, cells of {} m^3",
            summary.lattice, summary.cell_volume_m3
        );
        println!("voxels         {}", summary.voxels);
        println!("points         {}", summary.points);
        if let (Some(min), Some(max)) = (summary.min_m, summary.max_m) {
            println!("extent (m)     {min:.1?} to {max:.1?}");
        }
        println!("datum (m)      {:.3?}", summary.datum_m);
        println!("MSE per dim    {:.6} m^2", summary.mse_per_dimension_m2);
        println!("mean distance  {:.5} m", summary.mean_distance_m);
        println!("RMS distance   {:.5} m", summary.rms_m);
        println!("largest        {:.4} m", summary.max_distance_m);
        println!(
            "file           {} bytes, {:.2} a voxel",
            summary.file_bytes, summary.bytes_per_voxel
        );
        Ok(())
    }
}

impl Export {
    fn run(self) -> CliResult {
        let (list, _) = read(&self.map)?;
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
