//! Parameters of the marker publisher.

use lattice_runtime::params::{ParamError, Params};

/// How a voxel is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MarkerStyle {
    /// Its Voronoi cell, exposed faces only (TRIANGLE_LIST).
    Cells,
    /// A cube of the same volume at its centre (CUBE_LIST); exposed voxels only.
    Cubes,
    /// A point (POINTS); exposed voxels only.
    Points,
}

/// What the colour tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColorBy {
    /// Height of each vertex; 16 more bytes each.
    Height,
    /// One colour a marker, by the height of its block.
    Flat,
}

/// Everything that a [`super::VoxelMarkers`] can be told.
#[derive(Clone, Debug)]
pub struct MarkerOptions {
    /// How voxels are drawn.
    pub style: MarkerStyle,
    /// What the colour tells.
    pub color_by: ColorBy,
    /// Heights between two equal hues, in m.
    pub height_period_m: f64,
    /// Opacity.
    pub alpha: f32,
    /// Blocks are `2^block_bits` lattice indices a side.
    pub block_bits: u32,
    /// Largest serialised array.
    pub chunk_bytes: usize,
    /// Maps of more voxels are drawn as points.
    pub max_marker_voxels: usize,
    /// Largest map followed.
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
        let style = match params.string("style", "cells")?.as_str() {
            "cells" => MarkerStyle::Cells,
            "cubes" => MarkerStyle::Cubes,
            "points" => MarkerStyle::Points,
            other => {
                let reason = format!("'{other}', expected cells, cubes or points");
                return Err(params.invalid("style", reason));
            }
        };
        let color_by = match params.string("color_by", "height")?.as_str() {
            "height" => ColorBy::Height,
            "flat" => ColorBy::Flat,
            other => {
                let reason = format!("'{other}', expected height or flat");
                return Err(params.invalid("color_by", reason));
            }
        };
        let height_period_m = params.f64("height_period_m", defaults.height_period_m)?;
        if !(height_period_m.is_finite() && height_period_m > 0.0) {
            let reason = format!("{height_period_m}, expected more than zero");
            return Err(params.invalid("height_period_m", reason));
        }
        let block_bits = params.usize("block_bits", defaults.block_bits as usize)?;
        if !(1..=10).contains(&block_bits) {
            let reason = format!("{block_bits}, expected 1 to 10");
            return Err(params.invalid("block_bits", reason));
        }
        Ok(Self {
            style,
            color_by,
            height_period_m,
            alpha: params
                .f64("alpha", f64::from(defaults.alpha))?
                .clamp(0.01, 1.0) as f32,
            block_bits: block_bits as u32,
            chunk_bytes: params.usize("chunk_bytes", defaults.chunk_bytes)?,
            max_marker_voxels: params.usize("max_marker_voxels", defaults.max_marker_voxels)?,
            max_voxels: params.usize("max_voxels", defaults.max_voxels)?,
        })
    }
}
