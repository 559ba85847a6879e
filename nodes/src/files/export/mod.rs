//! Maps for other programs and for people: PLY of centres, PLY mesh of cells.

mod centers;
mod cloud;
mod error;
mod mesh;
pub mod palette;
mod ply;
mod vertices;

pub use centers::write_centers_ply;
pub use cloud::write_labelled_ply;
pub use error::ExportError;
pub use mesh::write_mesh_ply;
pub use palette::{HeightRange, category_color, color_at};
pub use ply::{PlyElement, ply_header};

use lattice_core::voxels::VoxelList;

/// The comment of a PLY header that says what the map is.
fn ply_comment(list: &VoxelList) -> String {
    let lattice = list.lattice();
    format!(
        "{} lattice, cell volume {} m^3, metres, map frame: x east, y north, z up",
        lattice.kind(),
        lattice.cell_volume_m3()
    )
}
