//! Maps as tables: map files to Parquet and back, and one map of many logs on a data engine.
//!
//! A voxel holds integers, whose sums do not depend on an order, so that one map of many is a
//! `SUM ... GROUP BY` over its cells: any engine does it, with the same bits. `docs/tables.md` is the
//! contract of the tables.

pub mod align;
#[cfg(feature = "ballista")]
pub mod cluster;
pub mod corrections;
pub mod engine;
pub mod files;
pub mod map_stage;
pub mod merge;
pub mod merged;
pub mod part;
pub mod rows;
pub mod schema;
pub mod status;
pub mod tables;
pub mod tile;

/// Any error on its way to the user.
pub type AnyError = Box<dyn std::error::Error + Send + Sync>;

/// Result with any error.
pub type Result<T = ()> = std::result::Result<T, AnyError>;
