//! Lattices: generators, exact quantizers, neighbours, Voronoi cells and keys.
//!
//! A lattice is the set of all `G w` for integer `w`, with the generator matrix `G` of Ryde & Brünig 2011, eq.
//! (8)-(12), scaled to a cell volume, or with any basis. [`Lattice::quantize`] finds the cell of a point.
//! [`Lattice::oriented`] rotates a lattice in the map.

mod basis;
mod batch;
mod block_key;
mod closed_form;
mod error;
mod generator;
mod index;
mod kind;
mod morton_key;
mod named_orientation;
mod neighbors;
mod orientation;
mod quantizer;
mod scaled_lattice;
mod shape;
mod voronoi;

pub use batch::{BatchBlock, BatchQuantizer, BatchSums, Coordinate, Simd};
pub use block_key::BlockKey;
pub(crate) use closed_form::nearest_integer;
pub use error::{LatticeError, MAX_CELL_VOLUME_M3, MAX_COVERING_SIDES, MIN_CELL_VOLUME_M3};
pub use index::LatticeIndex;
use index::{center, combine};
pub use kind::LatticeKind;
pub use morton_key::MortonKey;
pub use named_orientation::Orientation;
pub use scaled_lattice::Lattice;
pub(crate) use voronoi::corners;
pub use voronoi::{CellFace, VoronoiCell};

#[cfg(test)]
mod tests;
