//! Limit of an elevation map's size.

/// Maximum number of cells of an elevation map: 84 MB in five layers.
pub const MAX_ELEVATION_CELLS: u64 = 1 << 22;
