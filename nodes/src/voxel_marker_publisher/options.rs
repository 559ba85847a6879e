//! Options of the marker publisher.

use crate::options::{chunk_bytes, one_of};
use lattice_runtime::params::{ParamError, Params};

/// Marker shape of a voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MarkerStyle {
    /// Its Voronoi cell, exposed faces only (TRIANGLE_LIST).
    Cells,
    /// A cube of the same volume at its centre (CUBE_LIST); exposed voxels only.
    Cubes,
    /// A point (POINTS); exposed voxels only.
    Points,
}

/// Colour scheme.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColorBy {
    /// By the height of each vertex; 16 more bytes each.
    Height,
    /// The mean colour of each voxel, where the mapper keeps it; 16 more bytes per vertex.
    Color,
    /// One colour per marker, by the height of its block.
    Flat,
}

/// Options of [`super::VoxelMarkers`].
#[derive(Clone, Debug)]
pub struct MarkerOptions {
    /// Shape of voxels.
    pub style: MarkerStyle,
    /// Colour scheme.
    pub color_by: ColorBy,
    /// Height period of the hues, m.
    pub height_period_m: f64,
    /// Opacity.
    pub alpha: f32,
    /// Blocks are `2^block_bits` lattice indices a side.
    pub block_bits: u32,
    /// Largest serialized array.
    pub chunk_bytes: usize,
    /// Voxel count above which maps are drawn as points.
    pub max_marker_voxels: usize,
    /// Voxel limit of the followed map.
    pub max_voxels: usize,
}

impl Default for MarkerOptions {
    fn default() -> Self {
        Self {
            style: MarkerStyle::Cells,
            color_by: ColorBy::Height,
            height_period_m: 12.0,
            alpha: 1.0,
            block_bits: 3,
            chunk_bytes: 60_000,
            max_marker_voxels: 200_000,
            max_voxels: 20_000_000,
        }
    }
}

impl MarkerOptions {
    /// Reads the parameters of the node.
    pub fn from_params(params: &Params) -> Result<Self, ParamError> {
        let defaults = Self::default();
        let styles = [
            ("cells", MarkerStyle::Cells),
            ("cubes", MarkerStyle::Cubes),
            ("points", MarkerStyle::Points),
        ];
        let colors = [
            ("height", ColorBy::Height),
            ("flat", ColorBy::Flat),
            ("color", ColorBy::Color),
        ];
        let period_m = defaults.height_period_m;
        let block_bits = params.usize_in("block_bits", defaults.block_bits as usize, 1..=10)?;
        Ok(Self {
            style: one_of(params, "style", &styles)?,
            color_by: one_of(params, "color_by", &colors)?,
            height_period_m: params.f64_in("height_period_m", period_m, 1e-3..=1e9)?,
            alpha: params.f64_in("alpha", f64::from(defaults.alpha), 0.01..=1.0)? as f32,
            block_bits: block_bits as u32,
            chunk_bytes: chunk_bytes(params, defaults.chunk_bytes)?,
            max_marker_voxels: params.usize("max_marker_voxels", defaults.max_marker_voxels)?,
            max_voxels: params.positive("max_voxels", defaults.max_voxels)?,
        })
    }
}
