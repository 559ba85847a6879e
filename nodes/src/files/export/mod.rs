//! Map export: centres as PLY, PCD or text, a PLY mesh of cells, octrees, occupancy grids.

mod centers;
mod cloud;
mod grid;
mod mesh;
mod octree;
pub mod palette;
mod pcd;
mod vertices;

pub use centers::{write_centers_ply, write_centers_xyz};
pub use cloud::write_labelled_ply;
pub use grid::{write_grid_pgm, write_grid_yaml};
pub use mesh::write_mesh_ply;
pub use octree::{OctreeSummary, write_octree};
pub use palette::{HeightRange, category_color, color_at};
pub use pcd::write_centers_pcd;

use lattice_core::voxels::VoxelList;
use thiserror::Error;

use crate::octree::OctreeError;

/// Reason for a failed export.
#[derive(Debug, Error)]
pub enum ExportError {
    /// The system could not write.
    #[error("writing failed: {0}")]
    Io(#[from] std::io::Error),
    /// Vertex count above the limit of PLY, a signed 32-bit number.
    #[error(
        "the mesh has more than {} vertices: export the centres, or take larger cells",
        i32::MAX
    )]
    TooManyVertices,
    /// Octree that cannot be made.
    #[error(transparent)]
    Octree(#[from] OctreeError),
}

/// PLY element: name, count, and type and name of each property.
type PlyElement<'a> = (&'a str, u64, &'a [&'a str]);

/// Header of a binary little-endian PLY file, with one line of comment.
pub fn ply_header(comment: &str, elements: &[PlyElement]) -> String {
    let comment = comment.replace(['\n', '\r'], " ");
    let mut header = format!("ply\nformat binary_little_endian 1.0\ncomment {comment}\n");
    for (name, count, properties) in elements {
        header += &format!("element {name} {count}\n");
        for property in *properties {
            header += &format!("property {property}\n");
        }
    }
    header + "end_header\n"
}

/// Header comment that describes the map.
fn comment(list: &VoxelList) -> String {
    let lattice = list.lattice();
    format!(
        "{} lattice, cell volume {} m^3, metres, map frame: x east, y north, z up",
        lattice.kind(),
        lattice.cell_volume_m3()
    )
}
