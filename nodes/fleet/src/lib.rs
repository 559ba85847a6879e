//! Maps as tables: map files to Parquet and back, and one map of many logs on a data engine.
//!
//! A voxel holds integers, whose sums do not depend on an order. So one map of many is a `SUM ... GROUP BY` over its
//! cells, with the same bits by any engine. `docs/tables.md` specifies the tables.

pub mod align;
#[cfg(feature = "ballista")]
pub mod cluster;
pub mod compatibility;
pub mod corrections;
pub mod engine;
pub mod files;
pub mod map_stage;
pub mod merge;
pub mod merged;
pub mod part;
pub mod replay_options;
#[cfg(feature = "ballista")]
mod rooted_store;
pub mod roots;
pub mod rows;
pub mod schema;
pub mod status;
pub mod stop;
pub mod tables;
pub mod tile;
pub mod tile_files;

/// Any error, with a message for the user.
pub type AnyError = Box<dyn std::error::Error + Send + Sync>;

/// Result with any error.
pub type Result<T = ()> = std::result::Result<T, AnyError>;
