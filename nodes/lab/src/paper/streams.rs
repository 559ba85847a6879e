//! Random numbers of the reproductions, apart from those of the simulation.

use crate::random::Stream;

/// Purpose of random numbers; streams of different purposes are independent.
#[derive(Clone, Copy, Debug)]
#[repr(u64)]
pub enum Purpose {
    /// Points whose nearest lattice point is sought.
    Quantize = 256,
    /// Points of a cell.
    Cell = 257,
    /// Points that are spread evenly in space.
    Uniform = 258,
    /// Rotations and offsets of a cloud.
    Pose = 259,
    /// Choice of the points of a cloud.
    Thin = 260,
    /// Place of a lattice about a cloud.
    Offset = 261,
    /// Poses of lattices and starts of alignments.
    Matching = 272,
    /// Resamples of trials.
    Bootstrap = 273,
    /// Frames in which one calibration is measured.
    Frames = 768,
}

/// Stream `index` (below 2^48) of a purpose.
pub fn stream(seed: u64, purpose: Purpose, index: usize) -> Stream {
    Stream::numbered(seed, (purpose as u64) << 48 | index as u64)
}
