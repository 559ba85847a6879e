//! Map export: centres as PLY, PCD or text, a PLY mesh of cells, octrees, occupancy grids, elevation.

mod centers;
mod cloud;
mod elevation;
mod error;
mod grid;
mod mesh;
mod octree;
pub mod palette;
mod pcd;
mod ply_header;
mod vertices;

pub use centers::{write_centers_ply, write_centers_xyz};
pub use cloud::write_labelled_ply;
pub use elevation::write_elevation_tiff;
pub use error::ExportError;
pub use grid::{write_grid_pgm, write_grid_yaml};
pub use mesh::write_mesh_ply;
pub use octree::{OctreeSummary, write_octree};
pub use palette::{HeightRange, category_color, color_at};
pub use pcd::write_centers_pcd;
pub use ply_header::ply_header;
