//! Random numbers of the reproductions, apart from those of the simulation.

use lattice_core::random::Stream;

/// What random numbers are for; streams of different purposes are independent.
#[derive(Clone, Copy, Debug)]
#[repr(u64)]
pub enum Purpose {
    /// Points whose nearest lattice point is sought.
    Quantize = 256,
}

/// Stream `index` (below 2^48) of a purpose.
pub fn stream(seed: u64, purpose: Purpose, index: usize) -> Stream {
    Stream::numbered(seed, (purpose as u64) << 48 | index as u64)
}
