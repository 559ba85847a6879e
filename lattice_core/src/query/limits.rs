//! Limits of queries.

/// Maximum number of cells that a robot covers.
pub const MAX_ROBOT_CELLS: usize = 1 << 16;

/// Maximum coordinate and distance, metres: a thousand times the largest map.
pub const MAX_COORDINATE_M: f64 = 1e12;
