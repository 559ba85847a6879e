//! Largest grid.

/// Maximum number of cells of a grid.
pub const MAX_GRID_CELLS: u64 = 1 << 26;
