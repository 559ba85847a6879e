//! Random numbers of the reproductions, apart from those of the simulation.

use crate::random::Stream;

/// Purpose of random numbers; streams of different purposes are independent.
#[derive(Clone, Copy, Debug)]
#[repr(u64)]
pub enum Purpose {
    Quantize = 256,
    Cell = 257,
    Uniform = 258,
    Pose = 259,
    Thin = 260,
    Offset = 261,
    Matching = 272,
    Bootstrap = 273,
    Frames = 768,
}

/// Stream `index` (below 2^48) of a purpose.
pub fn stream(seed: u64, purpose: Purpose, index: usize) -> Stream {
    Stream::numbered(seed, (purpose as u64) << 48 | index as u64)
}
