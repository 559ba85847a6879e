//! Batch quantizer: [`Lattice::quantize`](super::Lattice::quantize) for many points.
//!
//! Points pass a single-precision kernel that certifies its results (`kernel`). The uncertified ones, some in a
//! thousand, use the double-precision closed form. A batch therefore gives the same bits as single points on every
//! machine and instruction set.

mod batch_quantizer;
mod coordinate;
mod form;
mod kernel;
mod simd;

pub use batch_quantizer::{BatchBlock, BatchQuantizer, BatchSums};
pub use coordinate::Coordinate;
pub use simd::Simd;

#[cfg(test)]
mod tests;
