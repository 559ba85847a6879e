//! `lattice map export`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use lattice_core::lattice::LatticeKind;

use super::grid::GridOptions;
use super::read;
use crate::CliResult;
#[cfg(feature = "lab")]
use lattice_lab::render::RenderOptions;
use lattice_nodes::files::atomic_write;
use lattice_nodes::files::export::{
    write_centers_pcd, write_centers_ply, write_centers_xyz, write_mesh_ply, write_octree,
};
use lattice_nodes::octree::OctreeForm;

/// Options of `lattice map export`.
#[derive(Args)]
pub struct Export {
    /// Map file, as written by `--map-out`
    map: PathBuf,
    /// File to write: .ply, .pcd or .xyz (centres), .bt or .ot (octree of octomap, of half the cell size) or .png (an
    /// image); PLY without extension
    #[arg(long, short, required_unless_present_any = ["grid", "elevation_map"])]
    out: Option<PathBuf>,
    /// Occupancy grid to write for Nav2's map_server: a .yaml file, and an image (.pgm) beside it
    #[arg(long, value_name = "YAML", conflicts_with_all = ["out", "form"], group = "ground")]
    grid: Option<PathBuf>,
    /// Heights of the ground to write: a GeoTIFF (.tif) with the layers of `elevation`
    #[arg(long, value_name = "TIF", conflicts_with_all = ["out", "form"], group = "ground")]
    elevation_map: Option<PathBuf>,
    #[command(flatten)]
    robot: GridOptions,
    /// Form to write; a `.png` file is always an image
    #[arg(long = "as", value_enum, default_value = "centers")]
    form: Form,
    #[cfg(feature = "lab")]
    #[command(flatten)]
    picture: Picture,
}

/// Camera of the image.
#[cfg(feature = "lab")]
#[derive(Args)]
struct Picture {
    /// Width of the image, pixels
    #[arg(long, default_value_t = 1200)]
    width: u32,
    /// Height of the image, pixels
    #[arg(long, default_value_t = 800)]
    height: u32,
    /// Viewing direction of the camera, clockwise from north, in degrees
    #[arg(long, default_value_t = 215.0)]
    azimuth: f64,
    /// Elevation of the camera above the horizon, in degrees
    #[arg(long, default_value_t = 35.0)]
    elevation: f64,
}

#[derive(Clone, Copy, ValueEnum, PartialEq, Eq)]
enum Form {
    /// Points: centre and count of every voxel
    Centers,
    /// PLY mesh: exposed faces of the cells
    Mesh,
    /// PNG image
    #[cfg(feature = "lab")]
    Png,
}

/// Output format.
#[derive(Clone, Copy)]
enum Target {
    CentersPly,
    CentersPcd,
    CentersXyz,
    Octree(OctreeForm),
    MeshPly,
    #[cfg(feature = "lab")]
    Png,
}

impl Export {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        let list = || read(&self.map).map(|(map, _)| map.into_list(usize::MAX));
        if let Some(grid) = &self.grid {
            return self.robot.write(&list()?, grid);
        }
        if let Some(heights) = &self.elevation_map {
            return self.robot.write_elevation(&list()?, heights);
        }
        let Some(out) = &self.out else {
            return Err("give --out, --grid or --elevation-map".into());
        };
        let target = self.target(out)?;
        let list = list()?;
        match target {
            Target::CentersPly => atomic_write::write(out, |out| write_centers_ply(&list, out)),
            Target::CentersPcd => atomic_write::write(out, |out| write_centers_pcd(&list, out)),
            Target::CentersXyz => atomic_write::write(out, |out| write_centers_xyz(&list, out)),
            Target::MeshPly => atomic_write::write(out, |out| write_mesh_ply(&list, out)),
            Target::Octree(form) => {
                let tree = atomic_write::write(out, |out| write_octree(&list, form, out))?;
                let exact = match list.lattice().kind() {
                    LatticeKind::Cubic => "each cell is eight voxels, exactly",
                    _ => "those with their centre in an occupied cell (--lattice cubic is exact)",
                };
                let (voxels, edge_m) = (tree.voxels, tree.resolution_m);
                println!("{voxels} voxels of {edge_m} m, half the cell size: {exact}");
                Ok(())
            }
            #[cfg(feature = "lab")]
            Target::Png => crate::lab::picture(&list, &self.picture.options(), out),
        }
    }

    /// Output format by extension and form; an error if they contradict each other.
    fn target(&self, out: &Path) -> Result<Target, String> {
        let extension = out.extension().unwrap_or_default().to_string_lossy();
        let known = match (extension.to_ascii_lowercase().as_str(), self.form) {
            ("ply" | "", Form::Centers) => return Ok(Target::CentersPly),
            ("pcd", Form::Centers) => return Ok(Target::CentersPcd),
            ("xyz", Form::Centers) => return Ok(Target::CentersXyz),
            ("bt", Form::Centers) => return Ok(Target::Octree(OctreeForm::Binary)),
            ("ot", Form::Centers) => return Ok(Target::Octree(OctreeForm::Full)),
            ("ply" | "", Form::Mesh) => return Ok(Target::MeshPly),
            #[cfg(feature = "lab")]
            ("png", _) | ("", Form::Png) => return Ok(Target::Png),
            (_, Form::Centers) => ".ply, .pcd, .xyz, .bt or .ot",
            (_, Form::Mesh) => ".ply",
            #[cfg(feature = "lab")]
            (_, Form::Png) => ".png",
        };
        let name = self.form.to_possible_value();
        let name = name.as_ref().map_or("this", |value| value.get_name());
        let out = out.display();
        Err(format!(
            "{out}: --as {name} writes {known}, no .{extension}"
        ))
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
