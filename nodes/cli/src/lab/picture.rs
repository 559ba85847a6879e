//! Pictures of maps.

use std::path::Path;

use lattice_core::voxels::VoxelList;
use lattice_lab::render::{RenderOptions, render_png};
use lattice_nodes::files::atomic_write;

use crate::CliResult;

/// Draws a map as a PNG file.
pub fn picture(list: &VoxelList, options: &RenderOptions, out: &Path) -> CliResult {
    atomic_write::write(out, |file| render_png(list, options, file))
}
